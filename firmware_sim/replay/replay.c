/* SPDX-License-Identifier: MIT */
/* Ticks of a recording: assigns each frame to a tick. */
#include "firmware_sim/replay/replay.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "drivers/protocol/native_encode.h"
#include "firmware_sim/config/config.h"
#include "firmware_sim/replay/replay_state.h"

enum { MOST_BYTES = 1 << 20, USUAL_MOST_BYTES = 1 << 17, NATIVE_RATE_BYTES = 2 * NATIVE_POINT_LEN };
static const uint32_t SEQ_BACK = UINT32_C(1) << 30; /* a reader takes that for another sequence (LOSSES.md) */
static const int64_t BACK_NS = 1000000000; /* a frame this much earlier than the one before is of another head */

/* ---- the frames */

static int64_t tick_of(const struct replay *r, int64_t t_ns)
{
    const int64_t n = t_ns / r->tick_ns;
    return t_ns % r->tick_ns < 0 ? n - 1 : n;
}

static void replay_fail(struct replay *r, const struct sh_err *err)
{
    if (!r->ends_then) sh_warn(r->options.report, "%s; the rest of it is not replayed", err->text);
    pthread_mutex_lock(&r->lock);
    if (r->failure.code == 0) r->failure = *err;
    command_queue_push(&r->cmd.queue, CMD_E_PULSES, "the rest of the recording can not be replayed");
    pthread_mutex_unlock(&r->lock);
}

/* Reads the next frame of the range into r->frame. 1: done; 0: there is none; -1: it failed, which is reported. */
static int replay_look(struct replay *r)
{
    struct sh_err err = {0};
    const double to_ns = r->options.to_s > 0.0 ? r->options.to_s * 1e9 : INFINITY;
    while (!r->has_frame) {
        const int got = recording_next(&r->recording, &r->frame, &err);
        if (got < 0) return replay_fail(r, &err), -1;
        if (got == 0) return 0;
        const double since_ns = (double)r->frame.t_ns - (double)r->first_ns;
        /* A device that is asked for scans has booted, so that part of a recording is left out. */
        const int is_early = since_ns < r->options.from_s * 1e9 || (r->is_device && r->frame.bytes[1] != NATIVE_POINTS);
        if (!r->in_range && is_early) {
            replay_keep_front(&r->front, r->frame.bytes);
            r->has_skipped = 1;
            continue;
        }
        if (since_ns > to_ns) return 0;
        r->has_frame = 1;
    }
    return 1;
}

/* Gives a frame the sequence number with which it is sent. Frames for one reader alone have none. */
static void renumber(struct replay *r, uint8_t *frame)
{
    struct native_header header;
    native_read_header(frame, &header);
    if ((header.flags & NATIVE_LOCAL) != 0) return;
    if (r->restarts && r->has_seq) r->seq_shift = r->last_seq + 1 - SEQ_BACK - header.seq;
    r->restarts = 0;
    r->last_seq = header.seq + r->seq_shift;
    r->has_seq = 1;
    if (r->seq_shift != 0) native_finish_frame(frame, r->last_seq);
}

static void replay_add(struct replay *r, const uint8_t *frame, uint32_t len, uint64_t tick)
{
    memcpy(r->bytes + r->len, frame, len);
    renumber(r, r->bytes + r->len);
    r->len += len;
    pthread_mutex_lock(&r->lock);
    replay_note_frame(r, frame, tick);
    pthread_mutex_unlock(&r->lock);
}

/* Readers have not seen the frames that were skipped. So they get descriptor, emitter and anchor, like a reader that
 * joins late. */
static void add_front(struct replay *r, uint64_t tick)
{
    uint8_t frame[REPLAY_FRONT_ROOM];
    for (int i = 0; i < REPLAY_FRONT; i++) {
        if (r->front.len[i] == 0) continue;
        memcpy(frame, r->front.bytes[i], r->front.len[i]);
        frame[3] |= NATIVE_REPEAT | NATIVE_LOCAL;
        native_finish_frame(frame, 0);
        replay_add(r, frame, r->front.len[i], tick);
    }
}

/* ---- time */

/* Counts frames anew from this tick on: it is the first tick of a time, or of another head within the recording. */
static void rebase(struct replay *r, uint64_t tick)
{
    r->start_tick = tick;
    r->base = r->last = tick_of(r, r->frame.t_ns);
}

/* A recording may have any times: this wraps instead of overflowing. */
static void set_shift(struct replay *r)
{
    r->shift_ns = (int64_t)((r->start_tick - (uint64_t)r->base) * (uint64_t)r->tick_ns);
}

/* The first time that it is played, the time of day becomes the recorded one. */
static void set_clock(struct replay *r)
{
    set_shift(r);
    if (r->utc0_ns != INT64_MIN && r->times == 1) r->utc0_ns = (int64_t)((uint64_t)r->utc0_ns - (uint64_t)r->shift_ns);
}

/* The tick with which the next frame goes out. */
static uint64_t due_tick(struct replay *r, uint64_t tick)
{
    const int64_t at = tick_of(r, r->frame.t_ns);
    if (r->frame.restarted || at < r->last - BACK_NS / r->tick_ns) {
        rebase(r, tick + 1);
        r->frame.restarted = 0;
    } else if (at > r->last) {
        r->last = at;
    }
    const double n = (double)(r->last - r->base) + 1.0;
    const double out = ceil(n / r->options.speed - 1e-9) - 1.0;
    return r->start_tick + (out < 0x1p62 ? (uint64_t)(out > 0.0 ? out : 0.0) : UINT64_C(1) << 62);
}

static void stop(struct replay *r, uint64_t tick, int wants_again)
{
    pthread_mutex_lock(&r->lock);
    r->playing = 0;
    r->wants_again = wants_again;
    replay_set_state(r, tick, HEAD_IDLE);
    pthread_mutex_unlock(&r->lock);
}

static void replay_begin(struct replay *r, uint64_t tick)
{
    struct sh_err err = {0};
    if (r->end_tick == UINT64_MAX && r->options.duration_s > 0.0) r->end_tick = tick + r->n_ticks;
    r->has_frame = r->in_range = r->has_skipped = 0;
    if (recording_rewind(&r->recording, &err) != SH_OK) {
        stop(r, tick, 0);
        replay_fail(r, &err);
        return;
    }
    const int found = replay_look(r);
    if (found <= 0) {
        stop(r, tick, 0);
        sh_fail(&err, SH_EINPUT, "%s: it has no frame from %.10g s on", r->options.path, r->options.from_s);
        if (found == 0) replay_fail(r, &err);
        return;
    }
    rebase(r, tick);
    r->in_range = 1;
    r->restarts = 1;
    pthread_mutex_lock(&r->lock);
    r->playing = 1;
    r->times++;
    set_clock(r);
    replay_set_state(r, tick, HEAD_SCANNING);
    pthread_mutex_unlock(&r->lock);
    if (r->has_skipped && r->frame.bytes[1] != NATIVE_DESCRIPTOR) add_front(r, tick);
}

/* Fills a tick with its frames. may_skip: time without frames passes at once. */
static void replay_fill(struct replay *r, uint64_t tick, int may_skip)
{
    int found;
    while ((found = replay_look(r)) == 1) {
        const uint64_t due = due_tick(r, tick);
        if (due > tick && !(may_skip && r->len == 0)) return;
        if (due > tick) r->start_tick -= due - tick;    /* may wrap below 0: due_tick() wraps back */
        if (r->len + r->frame.len > MOST_BYTES) return; /* the rest comes with the next tick */
        replay_add(r, r->frame.bytes, r->frame.len, tick);
        set_shift(r);
        r->has_frame = 0;
    }
    stop(r, tick, found == 0 && r->options.loop);
}

/* ---- the source */

struct wishes {
    int over, starts, idle; /* idle: nothing is played, and time need not pass */
};

/* is_late: frames of the tick before are still to be sent. A new time of playing, and the run's end, wait for them. */
static struct wishes take_wishes(struct replay *r, uint64_t tick, int is_late)
{
    struct wishes wishes;
    pthread_mutex_lock(&r->lock);
    const int stops = r->wants_stop && r->playing, ready = r->n_clients >= (int)r->options.clients;
    if (r->wants_stop) r->wants_again = 0;
    r->wants_stop = 0;
    wishes.starts = !is_late && ((r->wants_start && ready) || r->wants_again);
    if (wishes.starts) {
        r->wants_start = r->wants_again = 0;
        r->playing = 1;
    }
    const int waits = !r->ends_then || r->wants_start, plays = r->playing;
    wishes.over = !is_late && (r->ending || tick >= r->end_tick || (!waits && !plays));
    wishes.idle = !is_late && waits && !plays && r->end_tick == UINT64_MAX;
    pthread_mutex_unlock(&r->lock);
    if (stops) stop(r, tick, 0);
    return wishes;
}

static void replay_count(struct replay *r)
{
    atomic_fetch_add(&r->counters.fired, r->tick.n_fired);
    atomic_fetch_add(&r->counters.cast, r->tick.n_cast);
}

static enum loop_source_tick next(void *self, uint64_t tick, int may_idle, int again, struct ring_tick *out)
{
    struct replay *r = self;
    if (!again) {
        r->len = 0;
        r->tick = (struct ring_tick){.scan = r->tick.scan};
    }
    const struct wishes wishes = take_wishes(r, tick, again);
    if (wishes.over) return LOOP_SOURCE_OVER;
    if (wishes.idle && may_idle) return LOOP_SOURCE_IDLE;
    if (wishes.starts) replay_begin(r, tick);
    if (r->playing) {
        const struct ring_tick before = r->tick;
        r->tick = (struct ring_tick){.scan = before.scan};
        /* --duration counts such time, and protocols measure it */
        replay_fill(r, tick, may_idle && r->end_tick == UINT64_MAX && !r->is_device);
        replay_count(r);
        r->tick.n_cast += before.n_cast;
        r->tick.n_fired += before.n_fired;
        r->tick.n_lines += before.n_lines;
        ring_hits_add(&r->tick.hits, &before.hits);
    }
    *out = r->tick;
    out->bytes = r->bytes;
    out->len = r->len;
    out->shift_ns = r->shift_ns;
    return LOOP_SOURCE_TICK;
}

static void replay_describe(void *self, struct ring_tick *tick)
{
    struct replay *r = self;
    uint32_t len = 0;
    for (int i = 0; i < REPLAY_FRONT; i++) {
        memcpy(r->bytes + len, r->front.bytes[i], r->front.len[i]);
        len += r->front.len[i];
    }
    *tick = (struct ring_tick){.bytes = r->bytes, .len = len};
}

static uint32_t most_bytes(const void *self)
{
    (void)self;
    return MOST_BYTES + REPLAY_FRONT * REPLAY_FRONT_ROOM;
}

static uint32_t usual_bytes(const void *self)
{
    const struct replay *r = self;
    const double pulses = 1e-6 * (double)r->cfg->head.settings.prr_uhz * 1e-9 * (double)r->tick_ns;
    const double bytes = 4096.0 + NATIVE_RATE_BYTES * pulses;
    return bytes < USUAL_MOST_BYTES ? (uint32_t)bytes : USUAL_MOST_BYTES;
}

static struct fault_board *faults(const void *self)
{
    return ((const struct replay *)self)->faults;
}

static uint64_t rests_from(void *self)
{
    struct replay *r = self;
    pthread_mutex_lock(&r->lock);
    const int plays = r->playing || r->wants_start || r->wants_again;
    const uint64_t tick = r->n_changes == 0 ? 0 : r->change[(r->n_changes - 1) % REPLAY_CHANGES].tick + 1;
    pthread_mutex_unlock(&r->lock);
    return plays ? UINT64_MAX : tick;
}

static int64_t power_ns(void *self)
{
    (void)self;
    return 0;
}

static uint32_t power_ons(void *self)
{
    (void)self;
    return 1;
}

static uint32_t near_wrap(void *self)
{
    (void)self;
    return 0;
}

static double window_loss_db(void *self)
{
    (void)self;
    return 0.0;
}

static int64_t tick_ns(const void *self)
{
    return ((const struct replay *)self)->tick_ns;
}

static int files_fill(const void *self)
{
    return fault_board_is_filling(((const struct replay *)self)->faults);
}

static int close_files(void *self, struct sh_err *err)
{
    return fault_board_close(((struct replay *)self)->faults, err);
}

static struct device_counters *counters(void *self)
{
    return &((struct replay *)self)->counters;
}

static uint64_t scans(void *self)
{
    struct replay *r = self;
    pthread_mutex_lock(&r->lock);
    const uint64_t n = r->scans;
    pthread_mutex_unlock(&r->lock);
    return n;
}

static const struct talk *talk(const void *self, uint32_t link, const struct talk_options **options)
{
    const struct replay *r = self;
    *options = &r->options.talk_options;
    return r->options.talk != NULL && link < r->cfg->n_links ? r->options.talk[link] : NULL;
}

static int power_up(void *self, int64_t now_ns, const char **warning, struct sh_err *err)
{
    (void)self;
    (void)now_ns;
    (void)err;
    *warning = NULL;
    return SH_OK;
}

static void replay_end(void *self)
{
    struct replay *r = self;
    pthread_mutex_lock(&r->lock);
    r->ending = 1;
    pthread_mutex_unlock(&r->lock);
}

const struct loop_source_ops replay_source = {
    .command = replay_command,
    .overlong = replay_overlong,
    .command_once = replay_command_once,
    .utc_ns = replay_utc_ns,
    .next_fix_ns = replay_next_fix_ns,
    .fix = replay_fix,
    .pps = replay_pps,
    .session_opened = replay_session_opened,
    .session_closed = replay_session_closed,
    .report = replay_report,
    .faults = faults,
    .rests_from = rests_from,
    .power_ns = power_ns,
    .power_ons = power_ons,
    .near_wrap = near_wrap,
    .window_loss_db = window_loss_db,
    .talk = talk,
    .tick_ns = tick_ns,
    .counters = counters,
    .scans = scans,
    .power_up = power_up,
    .end = replay_end,
    .files_fill = files_fill,
    .close_files = close_files,
    .most_bytes = most_bytes,
    .usual_bytes = usual_bytes,
    .describe = replay_describe,
    .next = next,
};

/* ---- open and close */

int replay_open(struct config *cfg, const struct replay_options *options, struct replay **out, struct sh_err *err)
{
    *out = NULL;
    struct replay *r = calloc(1, sizeof *r);
    if (r == NULL) return sh_fail(err, SH_ENOMEM, "no memory");
    pthread_mutex_init(&r->lock, NULL);
    r->cfg = cfg;
    r->options = *options;
    r->tick_ns = llround(1e9 / cfg->loop.tick_hz);
    r->n_ticks = (uint64_t)ceil(options->duration_s * cfg->loop.tick_hz);
    r->end_tick = options->duration_s > 0.0 && !options->start ? r->n_ticks : UINT64_MAX;
    r->wants_start = options->start;
    for (uint32_t i = 0; i < cfg->n_links; i++) /* such a link opens a session for itself */
        r->n_clients -=
            cfg->link[i].type == LINK_FILE || cfg->link[i].type == LINK_NULL || cfg->link[i].type == LINK_UDP;
    r->ends_then = options->start && !options->loop;
    r->bytes = malloc(MOST_BYTES + REPLAY_FRONT * REPLAY_FRONT_ROOM);
    int rc = r->bytes != NULL ? SH_OK : sh_fail(err, SH_ENOMEM, "no memory");
    if (rc == SH_OK) rc = replay_open_recording(r, err);
    if (rc == SH_OK)
        rc = fault_board_create(&cfg->faults, options->truth, &r->counters.lost_truth_lines, &r->faults, err);
    r->desk = (struct fault_desk){.cfg = cfg, .board = r->faults, .no_head = 1};
    if (rc != SH_OK) {
        replay_free(r);
        return rc;
    }
    *out = r;
    return SH_OK;
}

void replay_free(struct replay *r)
{
    if (r == NULL) return;
    recording_close(&r->recording);
    fault_board_free(r->faults);
    pthread_mutex_destroy(&r->lock);
    free(r->bytes);
    free(r);
}

void replay_get_summary(struct replay *r, struct replay_summary *summary)
{
    struct scanhead_stats stats = {0};
    if (r->recording.stream != NULL) recording_stats(&r->recording, &stats);
    pthread_mutex_lock(&r->lock);
    *summary = (struct replay_summary){.times = r->times,
                                       .frames = r->frames,
                                       .bad_bytes = stats.bad_bytes,
                                       .repeated = stats.repeated,
                                       .late = stats.late,
                                       .cut = stats.cuts != 0};
    snprintf(summary->idn, sizeof summary->idn, "%s", r->idn);
    pthread_mutex_unlock(&r->lock);
}

int replay_check(struct replay *r, struct sh_err *err)
{
    return r->failure.code != 0 ? sh_fail(err, r->failure.code, "%s", r->failure.text) : SH_OK;
}
