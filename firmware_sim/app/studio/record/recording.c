/* SPDX-License-Identifier: MIT */
#include "firmware_sim/app/studio/record/recording.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "core/of_file.h"
#include "drivers/protocol/native.h"
#include "firmware_sim/app/progress.h"
#include "firmware_sim/base/clock.h"
#include "firmware_sim/command/head.h"

enum {
    REPLY_MS = 20000, /* a head that shares a busy machine has taken more than 5 s */
    NEXT_MS = 250,
    END_MS = 20000,
    LAST_MS = 60000,
    BOOT_MS = 30000,
    REPLUG_MS = 1000,
    COUNTS_MS = 2000, /* telemetry comes each second */
    SILENT_MS = 2000
};

struct recording {
    int64_t now_ns;    /* when the last wait for a frame ended */
    int64_t pulses_ns; /* when pulses came last */
    int64_t heard_ns;  /* the same, or when the head was last asked why none come */
    struct scanhead *sh;
    const struct recording_options *o;
    struct recording_result *result;
    char reply[512];
    int64_t next_report_ns, scan_t0_ns; /* monotonic; device time of the scan's start, -1 before it */
    int interrupted;                    /* asked to end the whole recording */
    int stopping;                       /* the scan at hand is to end */
    int scan_started;                   /* SCAN_START or points were seen since SCAN:STAR */
    int scan_over, cut_short, broken;
    int has_refused;       /* a warning has named the first frame with wrong contents */
    int is_done;           /* the scan is over, and only its final counts are waited for: not for a head that is gone */
    double scan_s, into_s; /* how long the scan lasts, 0: not known; the time since its start */
    uint32_t station;      /* at hand */
};

/* The answer is in r->reply. */
static int command(struct recording *r, const char *line, struct sh_err *err)
{
    int rc = scanhead_command(r->sh, line, r->reply, sizeof r->reply, REPLY_MS);
    if (rc != SCANHEAD_OK) return sh_fail(err, rc, "%s: %s", line, scanhead_error(r->sh));
    if (strncmp(r->reply, "ERR", 3) == 0) return sh_fail(err, SH_ESTATE, "the head refused %s: %s", line, r->reply);
    return SH_OK;
}

static int set(struct recording *r, const char *header, long value, struct sh_err *err)
{
    char line[64];
    snprintf(line, sizeof line, "%s %ld", header, value);
    return command(r, line, err);
}

static void count_points(struct recording *r, const struct scanhead_frame *frame)
{
    uint32_t empty, with_reflectance;
    struct scanhead_info info;
    native_count_points(frame->payload, frame->n_points, &empty, &with_reflectance);
    r->result->with_reflectance += with_reflectance;
    r->result->empty += empty;
    r->result->points += frame->n_points - empty;
    if (scanhead_get_info(r->sh, &info) != SCANHEAD_OK) r->result->unplaced += frame->n_points;
}

/* The head stopped or failed while the mirror was still spinning up. There is no scan, so no SCAN_END
 * comes. */
static int gives_up(const struct scanhead_frame *frame)
{
    return frame->event == SCANHEAD_EV_STATE && frame->event_value[1] == HEAD_SPIN_UP &&
           frame->event_value[0] != HEAD_SCANNING;
}

/* The head lost power. A reader in the head's own process gets this event; others lose the connection. */
static int goes_off(const struct scanhead_frame *frame)
{
    return frame->type == SCANHEAD_EVENT && frame->event == SCANHEAD_EV_STATE && frame->event_value[0] == HEAD_OFF;
}

static void count_line(struct recording *r, const struct scanhead_frame *frame)
{
    struct scanhead_line_end end;
    if (scanhead_line_end(r->sh, frame, &end) != SCANHEAD_OK) return;
    r->result->crowded += end.n_crowded;
    r->result->faint += end.n_faint;
    r->result->unfit += end.n_unfit;
}

static void count_waves(struct recording *r, const struct scanhead_frame *frame)
{
    const int64_t lost = scanhead_waves_lost(r->sh, frame);
    if (lost > 0) r->result->lost_samples += (uint64_t)lost;
}

static int has_lost_frames(const struct recording *r)
{
    struct scanhead_stats stats;
    scanhead_get_stats(r->sh, &stats);
    return stats.seq_lost + stats.reader_lost + stats.dropped + stats.restarts + stats.refused != 0;
}

static void count_pulses(struct recording *r, const struct scanhead_frame *frame)
{
    const int is_asked = frame->type == SCANHEAD_TELEMETRY || frame->type == SCANHEAD_EVENT;
    const int lost = is_asked && has_lost_frames(r);
    enum recording_news news = recording_count(&r->result->counts, frame, lost);
    if (news == RECORDING_NOTHING) return;
    if (news == RECORDING_END_LOST) sh_warn(r->o->report, "the scan's end was lost; the head goes on without it");
    r->scan_over = r->scan_started = 1;
    r->broken = 0;
}

/* Each of the `frames` of a sphere head has a line for every ring, so scan_s gets the number of rings as a factor. */
static uint32_t lines_of_frame(const struct scanhead *sh)
{
    struct scanhead_emitter e;
    return scanhead_get_emitter(sh, &e) == SCANHEAD_OK && e.kind == SCANHEAD_EMIT_SPHERE ? e.rings : 1;
}

static void look_at(struct recording *r, const struct scanhead_frame *frame)
{
    r->result->frames++;
    count_pulses(r, frame);
    if (frame->type == SCANHEAD_POINTS) {
        r->scan_started = 1;
        if (r->scan_t0_ns < 0) r->scan_t0_ns = native_since_ns(frame->t_ns, frame->scan_t0_ns);
    }
    if (frame->type == SCANHEAD_DESCRIPTOR) r->scan_s = progress_scan_s(frame);
    if (frame->type == SCANHEAD_EMITTER) r->scan_s *= lines_of_frame(r->sh);
    if (frame->type == SCANHEAD_LINE_END) count_line(r, frame);
    if (frame->type == SCANHEAD_WAVES) count_waves(r, frame);
    if (frame->type != SCANHEAD_EVENT) return;
    if (frame->event == SCANHEAD_EV_SCAN_START) {
        r->scan_t0_ns = (int64_t)frame->event_value[1];
        r->scan_started = 1;
    }
    if (gives_up(frame) && !r->scan_started) r->scan_over = 1;
}

static uint32_t last_of_all(const struct recording_options *o)
{
    return o->end_station != 0 ? o->end_station : o->last_station;
}

/* The share of the whole recording that is done; negative where its end is not known. */
static double fraction_done(const struct recording *r)
{
    const struct recording_options *o = r->o;
    struct scanhead_stats stats;
    scanhead_get_stats(r->sh, &stats);
    if (o->source_bytes > 0) return fmin(1.0, (double)stats.bytes / (double)o->source_bytes);
    double scan_s = r->scan_s;
    if (o->duration_s > 0.0 && (!(scan_s > 0.0) || o->duration_s < scan_s)) scan_s = o->duration_s;
    if (o->listen || !(scan_s > 0.0)) return -1.0;
    const uint32_t begin = o->begin_station != 0 ? o->begin_station : o->first_station;
    const double n = 1.0 + last_of_all(o) - begin, before = (double)r->station - begin;
    return (before + fmin(1.0, fmax(0.0, r->into_s / scan_s))) / n;
}

static int recording_report(struct recording *r, struct sh_err *err)
{
    if (r->now_ns < r->next_report_ns) return SH_OK;
    r->next_report_ns = r->now_ns + 1000000000;
    const int rc = r->o->second != NULL ? r->o->second(r->o->ctx, err) : SH_OK;
    if (rc != SH_OK || !r->o->progress) return rc;
    char text[96];
    snprintf(text, sizeof text, "recording: %.2f M points, %.2f M pulses", 1e-6 * (double)r->result->points,
             1e-6 * (double)r->result->counts.pulses);
    sh_progress(r->o->report, text, fraction_done(r));
    return SH_OK;
}

static int is_interrupted(struct recording *r)
{
    if (r->o->interrupted != NULL && r->o->interrupted()) r->interrupted = 1;
    return r->interrupted;
}

/* Whether rc says that the head was unplugged or its bus reset, and --replug asks to wait for it. */
static int is_gone(const struct recording *r, int rc)
{
    return r->o->replug_s > 0.0 && (rc == SCANHEAD_ELOST || rc == SCANHEAD_ERESET || rc == SCANHEAD_ECLOSED);
}

/* Waits for a head that is gone. Where it scans no more when it is back, the scan ended meanwhile. Where it still
 * scans, the rest of the scan will come. The head's state is in r->reply. */
static int replug(struct recording *r, int why, struct sh_err *err)
{
    const int64_t end_ns = clock_now_ns() + (int64_t)(1e9 * r->o->replug_s);
    int rc, scanning = 0;
    sh_warn(r->o->report, "%s; waiting for it", scanhead_error(r->sh));
    do {
        rc = scanhead_reattach(r->sh, REPLUG_MS);
        if (rc == SCANHEAD_OK) rc = scanhead_command(r->sh, "HEAD:STAT?", r->reply, sizeof r->reply, REPLY_MS);
    } while (rc != SCANHEAD_OK && clock_now_ns() < end_ns && !is_interrupted(r));
    if (rc != SCANHEAD_OK) return sh_fail(err, SH_ELOST, "the head did not come back: %s", scanhead_error(r->sh));
    scanning = strncmp(r->reply, "s", 1) == 0; /* spin-up, scanning, spin-down */
    sh_warn(r->o->report, "the head is back");
    *(why == SCANHEAD_ERESET ? &r->result->bus_resets : &r->result->replugs) += 1;
    int within = r->result->counts.within;
    r->result->broken_scans += (uint64_t)(within && !r->broken);
    r->broken = within && scanning;
    if (!within || scanning) return 0;
    r->scan_over = 1;
    recording_count_end(&r->result->counts);
    return 0;
}

static int is_long_enough(const struct recording *r, const struct scanhead_frame *frame)
{
    if (!(r->o->duration_s > 0.0) || r->o->head_ends || r->scan_t0_ns < 0) return 0;
    return (double)native_since_ns(frame->t_ns, r->scan_t0_ns) >= 1e9 * r->o->duration_s;
}

/* Wrong bytes of a recording are wrong input. */
static int of_source(const struct recording *r, int rc, struct sh_err *err)
{
    return r->o->file != NULL ? sh_of_file(rc, err) : rc;
}

static int fail_end(const struct recording *r, int code, const char *how, struct sh_err *err)
{
    const char *file = r->o->file;
    return of_source(
        r, sh_fail(err, code, "%s%sthe stream ended %s", file != NULL ? file : "", file != NULL ? ": " : "", how), err);
}

/* Takes one frame. Returns 1: got one; 0: none in time; negative: the recording is over. */
static int step(struct recording *r, int timeout_ms, struct sh_err *err)
{
    struct scanhead_frame frame;
    int rc = scanhead_next(r->sh, &frame, timeout_ms);
    r->now_ns = clock_now_ns();
    const int reported = recording_report(r, err);
    if (reported != SH_OK) return reported;
    if (rc == SCANHEAD_ETIMEOUT) return 0;
    if (is_gone(r, rc) && !r->is_done) return replug(r, rc, err);
    if (rc != SCANHEAD_OK) return of_source(r, sh_fail(err, rc, "%s", scanhead_error(r->sh)), err);
    look_at(r, &frame);
    if (frame.type == SCANHEAD_POINTS) {
        r->heard_ns = r->pulses_ns = r->now_ns;
        count_points(r, &frame);
    }
    if (r->scan_t0_ns >= 0) r->into_s = 1e-9 * (double)native_since_ns(frame.t_ns, r->scan_t0_ns);
    if (is_long_enough(r, &frame)) r->stopping = 1;
    rc = r->o->frame(r->o->ctx, r->sh, &frame, err);
    if (rc == SH_OK && goes_off(&frame) && !r->o->listen)
        return sh_fail(err, SH_ELOST, "the head lost power, so the scan has no end");
    return rc == SH_OK ? 1 : rc;
}

/* Returns early, with SH_OK, when interrupted. */
static int wait_idle(struct recording *r, struct sh_err *err)
{
    int64_t deadline_ns = clock_now_ns() + (int64_t)BOOT_MS * 1000000;
    while (clock_now_ns() < deadline_ns) {
        if (is_interrupted(r)) return SH_OK;
        int rc = command(r, "HEAD:STAT?", err);
        if (is_gone(r, rc)) {
            rc = replug(r, rc, err);
            deadline_ns = clock_now_ns() + (int64_t)BOOT_MS * 1000000;
        }
        if (rc != SH_OK) return rc;
        if (strcmp(r->reply, "idle") == 0) return SH_OK;
        if (strcmp(r->reply, "scanning") == 0 || strcmp(r->reply, "fault") == 0 || strcmp(r->reply, "off") == 0)
            return sh_fail(err, SH_ESTATE, "the state of the head is %s; --listen records it without commands",
                           r->reply);
        rc = step(r, 20, err); /* frames keep coming meanwhile */
        if (rc < 0) return rc;
    }
    return sh_fail(err, SH_ETIMEOUT, "the head was not idle within %d s", BOOT_MS / 1000);
}

static int stop_scan(struct recording *r, struct sh_err *err)
{
    int rc = scanhead_command(r->sh, "SCAN:STOP", r->reply, sizeof r->reply, REPLY_MS);
    if (rc != SCANHEAD_OK) return sh_fail(err, rc, "SCAN:STOP: %s", scanhead_error(r->sh));
    r->cut_short = r->interrupted && strncmp(r->reply, "ERR", 3) != 0; /* refused: the scan has just ended by itself */
    return SH_OK;
}

/* No pulses have come for a while. The scan's end may be among frames that a slow reader lost. A recorder that only
 * listens does not ask: its source may be unable to answer, and telemetry or the next scan brings the end. */
static int look_for_end(struct recording *r, struct sh_err *err)
{
    if (!has_lost_frames(r) || (r->o->listen && !(r->o->replug_s > 0.0))) return SH_OK;
    int rc = command(r, "HEAD:STAT?", err);
    if (is_gone(r, rc)) return replug(r, rc, err);
    if (rc != SH_OK || strcmp(r->reply, "idle") != 0) return rc;
    sh_warn(r->o->report, "the scan's end was lost; the head is idle");
    r->scan_started = r->scan_over = 1;
    r->broken = 0;
    recording_count_end(&r->result->counts);
    return SH_OK;
}

/* The scan was told to end at asked_ns. Pulses from before may still come for a while, from a long queue or a slow
 * link. */
static int has_waited(const struct recording *r, int64_t asked_ns)
{
    const int64_t now_ns = clock_now_ns(), last_ns = r->pulses_ns > asked_ns ? r->pulses_ns : asked_ns;
    return now_ns - last_ns > (int64_t)END_MS * 1000000 || now_ns - asked_ns > (int64_t)LAST_MS * 1000000;
}

/* If the telemetry with the final counts of the scan was lost, the next one has them, too. A stream that ends meanwhile
 * is no failure here: the scan is over, and the next command finds the end. */
static int await_counts(struct recording *r, struct sh_err *err)
{
    const int64_t end_ns = clock_now_ns() + (int64_t)COUNTS_MS * 1000000;
    int rc = SH_OK;
    r->is_done = 1;
    while (rc >= 0 && r->result->counts.due.scan != 0 && clock_now_ns() < end_ns && !is_interrupted(r))
        rc = step(r, NEXT_MS, err);
    r->is_done = 0;
    return rc >= 0 || rc == SH_ECLOSED || rc == SH_ELOST || rc == SH_ERESET ? SH_OK : rc;
}

static int recording_follow(struct recording *r, struct sh_err *err)
{
    int64_t asked_ns = 0;
    r->heard_ns = clock_now_ns();
    while (!r->scan_over) {
        if (is_interrupted(r)) r->stopping = 1;
        if (r->stopping && r->o->listen) return SH_OK;
        if (r->stopping && asked_ns == 0) {
            int rc = stop_scan(r, err);
            if (rc != SH_OK) return rc;
            asked_ns = clock_now_ns();
        }
        if (asked_ns != 0 && has_waited(r, asked_ns))
            return sh_fail(err, SH_ETIMEOUT, "the head did not end the scan in %.0f s after SCAN:STOP",
                           1e-9 * (double)(clock_now_ns() - asked_ns));
        int rc = step(r, NEXT_MS, err);
        if (rc < 0) return rc;
        if (r->now_ns - r->heard_ns < (int64_t)SILENT_MS * 1000000) continue;
        rc = look_for_end(r, err);
        if (rc != SH_OK) return rc;
        r->heard_ns = clock_now_ns();
    }
    if (r->o->listen) return SH_OK;
    if (r->scan_started || r->stopping) return await_counts(r, err);
    return sh_fail(err, SH_ESTATE, "the head ended the scan before its first pulse");
}

static int start_scan(struct recording *r, uint32_t station, struct sh_err *err)
{
    int rc = wait_idle(r, err);
    if (rc == SH_OK && !r->interrupted && r->o->prepare != NULL) rc = r->o->prepare(r->o->ctx, station, err);
    if (rc == SH_ESTOPPED && is_interrupted(r)) return SH_OK;
    if (rc == SH_OK && r->interrupted) return SH_OK;
    if (rc == SH_OK && station != 0) rc = set(r, "HEAD:STATION", (long)station, err);
    if (rc == SH_OK && r->o->frames >= 0) rc = set(r, "SCAN:FRAM", r->o->frames, err);
    return rc == SH_OK ? command(r, "SCAN:STAR", err) : rc;
}

static int record_scan(struct recording *r, uint32_t station, struct sh_err *err)
{
    r->stopping = r->scan_over = r->scan_started = r->cut_short = 0;
    r->scan_t0_ns = -1;
    r->into_s = 0.0;
    r->station = station;
    int rc = r->o->listen ? SH_OK : start_scan(r, station, err);
    r->scan_over = r->scan_started = 0; /* what came before the reply is of another scan */
    if (rc != SH_OK || (r->interrupted && !r->o->listen)) return rc;
    return recording_follow(r, err);
}

/* A scan without end, of a head that stands, is complete when its user ends it. */
static int is_endless(const struct recording *r)
{
    struct scanhead_info info;
    return !(r->o->duration_s > 0.0) && scanhead_get_info(r->sh, &info) == SCANHEAD_OK && info.frames == 0 &&
           !info.moving;
}

/* Names what an interruption left out: the end of the scan at hand, and the scans from later stations. */
static void name_missing(struct recording *r, uint32_t station)
{
    char *text = r->result->missing;
    size_t room = sizeof r->result->missing;
    int whole = r->scan_started && (!r->cut_short || is_endless(r));
    uint32_t first = r->scan_started ? station + 1 : station, last = last_of_all(r->o);
    if (r->scan_started && !whole) {
        int n = station != 0 ? snprintf(text, room, "the end of the scan from station %u", station)
                             : snprintf(text, room, "the end of the scan");
        text += n;
        room -= (size_t)n;
    }
    const char *and = r->scan_started && !whole ? " and " : "";
    if (station == 0 && !r->scan_started)
        snprintf(text, room, "the scan");
    else if (station != 0 && first < last)
        snprintf(text, room, "%sthe scans from stations %u to %u", and, first, last);
    else if (station != 0 && first == last)
        snprintf(text, room, "%sthe scan from station %u", and, first);
}

static int record_listening(struct recording *r, struct sh_err *err)
{
    int rc = record_scan(r, 0, err);
    /* More scans may follow until the stream ends. */
    while (rc == SH_OK && !r->stopping) {
        r->scan_over = 0;
        rc = recording_follow(r, err);
    }
    return rc;
}

static int record_stations(struct recording *r, struct sh_err *err)
{
    uint32_t station = r->o->first_station;
    int rc = record_scan(r, station, err);
    while (rc == SH_OK && !r->interrupted && station < r->o->last_station)
        rc = record_scan(r, ++station, err);
    if (rc == SH_OK && r->interrupted) name_missing(r, station);
    return rc;
}

/* Reports the first frame that is left out for its contents. The result has how many were. */
static void note(void *ctx, const struct scanhead_notice *notice)
{
    struct recording *r = ctx;
    if (notice->kind != SCANHEAD_NOTICE_REFUSED || r->has_refused) return;
    r->has_refused = 1;
    sh_warn(r->o->report, "frame %lu at byte %llu is left out: %s", (unsigned long)notice->seq,
            (unsigned long long)notice->at_byte, notice->why);
}

int recording_run(struct scanhead *sh, const struct recording_options *options, struct recording_result *result,
                  struct sh_err *err)
{
    memset(result, 0, sizeof *result);
    result->is_file = options->source_bytes > 0;
    const int64_t start_ns = clock_now_ns();
    struct recording r = {.sh = sh, .o = options, .result = result, .next_report_ns = start_ns + 1000000000};
    if (options->hash) scanhead_hash_start(sh);
    scanhead_on_notice(sh, note, &r);
    int rc = options->listen ? record_listening(&r, err) : record_stations(&r, err);
    result->wall_s = 1e-9 * (double)(clock_now_ns() - start_ns);
    scanhead_on_notice(sh, NULL, NULL);
    scanhead_get_stats(sh, &result->stream);
    if (options->hash) scanhead_hash_hex(sh, result->sha256);
    if (rc == SH_ECLOSED && options->listen && result->frames == 0)
        return fail_end(&r, SH_EFORMAT, "without a frame", err);
    if (rc == SH_ECLOSED && options->listen && !result->counts.within) return SH_OK;
    return rc == SH_ECLOSED && result->counts.within ? fail_end(&r, rc, "in the middle of a scan", err) : rc;
}
