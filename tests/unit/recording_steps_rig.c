/* SPDX-License-Identifier: MIT */
#include "tests/unit/recording_steps_rig.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>
#include <cmocka.h>

#include "drivers/protocol/native.h"
#include "firmware_sim/app/progress.h"
#include "tests/unit/clock_rig.h"

enum { BEGAN_MS = 1000 };

const struct turn *turns;
const struct reply_is *replies;
struct recording_options options;
struct recording_result result;
struct sh_err err;
char warned[512], progress[512];
struct scanhead_stats stats;
struct scanhead_info info;
int stop_ms, back_ms, rings, is_count_due;
double scan_s;

static struct scanhead *const handle = (struct scanhead *)&options;
static int used[16]; /* replies, by their place */

static int now(void)
{
    return (int)(clock_rig_ns / MS) - BEGAN_MS;
}

static void (*note)(void *ctx, const struct scanhead_notice *notice);
static void *note_ctx;

void scanhead_on_notice(struct scanhead *sh, void (*fn)(void *ctx, const struct scanhead_notice *notice), void *ctx)
{
    note = sh == handle ? fn : NULL;
    note_ctx = ctx;
}

int scanhead_next(struct scanhead *sh, struct scanhead_frame *frame, int timeout_ms)
{
    if (sh != handle || (timeout_ms != 250 && timeout_ms != 20)) return SCANHEAD_EINPUT;
    for (; turns->rc == 2; turns++) {
        const struct scanhead_notice it = {
            .kind = SCANHEAD_NOTICE_REFUSED, .seq = turns->frame.seq, .at_byte = 1234, .n = 1, .why = "it is wrong"};
        note(note_ctx, &it);
    }
    if (turns->rc == 1) {
        clock_rig_ns += 250 * MS;
        return SCANHEAD_ETIMEOUT;
    }
    clock_rig_ns += turns->ms * MS;
    *frame = turns->frame;
    return turns++->rc;
}

int scanhead_command(struct scanhead *sh, const char *command, char *reply, size_t reply_len, int timeout_ms)
{
    if (sh != handle || timeout_ms != 20000 || reply_len != 512) return SCANHEAD_EINPUT;
    say("%s@%d ", command, now());
    const struct reply_is *found = NULL;
    for (int i = 0; replies[i].command != NULL; i++) {
        if (strcmp(replies[i].command, command) != 0) continue;
        found = &replies[i];
        if (!used[i]) {
            used[i] = 1;
            break;
        }
    }
    snprintf(reply, reply_len, "%s", found != NULL ? found->text : "OK");
    return found != NULL ? found->rc : SCANHEAD_OK;
}

int scanhead_reattach(struct scanhead *sh, int timeout_ms)
{
    if (sh != handle || timeout_ms != 1000) return SCANHEAD_EINPUT;
    clock_rig_ns += 1000 * MS;
    say("reattach@%d ", now());
    return back_ms != 0 && now() >= back_ms ? SCANHEAD_OK : SCANHEAD_ELOST;
}

const char *scanhead_error(const struct scanhead *sh)
{
    return sh == handle ? "it broke" : "?";
}

void scanhead_get_stats(const struct scanhead *sh, struct scanhead_stats *out)
{
    *out = sh == handle ? stats : (struct scanhead_stats){0};
}

int scanhead_get_info(const struct scanhead *sh, struct scanhead_info *out)
{
    *out = info;
    return sh == handle ? SCANHEAD_OK : SCANHEAD_EINPUT;
}

int scanhead_get_emitter(const struct scanhead *sh, struct scanhead_emitter *out)
{
    *out = (struct scanhead_emitter){.kind = rings != 0 ? SCANHEAD_EMIT_SPHERE : SCANHEAD_EMIT_LINE,
                                     .rings = (uint32_t)(rings != 0 ? rings : 7)};
    return sh == handle ? SCANHEAD_OK : SCANHEAD_EINPUT;
}

int scanhead_line_end(struct scanhead *sh, const struct scanhead_frame *frame, struct scanhead_line_end *out)
{
    *out = (struct scanhead_line_end){.n_crowded = 1, .n_faint = 2, .n_unfit = 3};
    return sh == handle && frame->flags == 0 ? SCANHEAD_OK : SCANHEAD_EFORMAT;
}

int64_t scanhead_waves_lost(struct scanhead *sh, const struct scanhead_frame *frame)
{
    return sh == handle && frame->flags == 0 ? 5 : SCANHEAD_EFORMAT;
}

void scanhead_hash_start(struct scanhead *sh)
{
    say(sh == handle ? "hash " : "HASH ");
}

void scanhead_hash_hex(const struct scanhead *sh, char hex[65])
{
    strcpy(hex, sh == handle ? "12ab" : "");
}

void native_count_points(const uint8_t *payload, uint32_t n, uint32_t *n_empty, uint32_t *n_reflectances)
{
    (void)payload;
    *n_empty = n / 10 * 3;
    *n_reflectances = n / 10 * 2;
}

double progress_scan_s(const struct scanhead_frame *descriptor)
{
    return descriptor->type == SCANHEAD_DESCRIPTOR ? scan_s : -1;
}

/* Telemetry shows a lost end where frames were lost. */
enum recording_news recording_count(struct recording_counts *counts, const struct scanhead_frame *frame,
                                    int frames_lost)
{
    if (frame->type == SCANHEAD_POINTS) {
        counts->within = 1;
        counts->pulses += frame->n_points;
    }
    if (frame->type == SCANHEAD_TELEMETRY) counts->due.scan = 0;
    if (frame->type == SCANHEAD_TELEMETRY) return frames_lost ? RECORDING_END_LOST : RECORDING_NOTHING;
    if (frame->type != SCANHEAD_EVENT || frame->event != SCANHEAD_EV_SCAN_END) return RECORDING_NOTHING;
    counts->within = 0;
    counts->due.scan = is_count_due ? 1 : 0;
    counts->scans++;
    return RECORDING_SCAN_OVER;
}

void recording_count_end(struct recording_counts *counts)
{
    counts->within = 0;
    say("count_end ");
}

static int prepare(void *ctx, uint32_t station, struct sh_err *e)
{
    (void)e;
    say(ctx == &result ? "prepare%u@%d " : "PREPARE ", station, now());
    return SH_OK;
}

static int take(void *ctx, struct scanhead *sh, const struct scanhead_frame *frame, struct sh_err *e)
{
    if (ctx != &result || sh != handle) say("FRAME ");
    return frame->flags == 99 ? sh_fail(e, SH_EIO, "the disk is full") : SH_OK;
}

static int second(void *ctx, struct sh_err *e)
{
    (void)e;
    say(ctx == &result ? "second@%d " : "SECOND ", now());
    return SH_OK;
}

static int interrupted(void)
{
    return stop_ms != 0 && now() >= stop_ms;
}

static void warn(void *ctx, const char *text)
{
    (void)ctx;
    snprintf(warned + strlen(warned), sizeof warned - strlen(warned), "%s\n", text);
}

static void say_progress(void *ctx, const char *what, double fraction)
{
    (void)ctx;
    const size_t n = strlen(progress);
    snprintf(progress + n, sizeof progress - n, "%d %s: %.3f\n", now(), what, fraction);
}

static const struct sh_report REPORT = {.warn = warn, .progress = say_progress};

int make_recording(void **state)
{
    static const struct reply_is idle[] = {{"HEAD:STAT?", "idle", 0}, {NULL, NULL, 0}};
    static const struct turn none[] = {LAST};
    (void)state;
    options = (struct recording_options){.frames = -1,
                                         .report = &REPORT,
                                         .prepare = prepare,
                                         .frame = take,
                                         .second = second,
                                         .ctx = &result,
                                         .interrupted = interrupted};
    replies = idle;
    turns = none;
    memset(used, 0, sizeof used);
    trace[0] = warned[0] = progress[0] = '\0';
    stats = (struct scanhead_stats){0};
    info = (struct scanhead_info){.frames = 1};
    stop_ms = back_ms = rings = is_count_due = 0;
    scan_s = 0;
    clock_rig_ns = BEGAN_MS * MS;
    return 0;
}

void run_it(int rc)
{
    assert_int_equal(recording_run(handle, &options, &result, &err), rc);
    assert_null(note); /* its notices would go to a recording that is over */
}
