/* SPDX-License-Identifier: MIT */
/* Plays a recording: assigns each frame to a tick. */
#include <math.h>
#include <string.h>

#include "drivers/protocol/native_encode.h"
#include "firmware_sim/replay/replay_state.h"

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

/* Takes the time of day from a frame that is skipped. Here and in replay_add that is only for the first round: later
 * ones repeat the recording, but the time of day goes on. */
static void take_skipped_clock(struct replay *r)
{
    pthread_mutex_lock(&r->lock);
    replay_clock_take(&r->clock, r->frame.bytes, 0);
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
        /* A device that is asked for scans has booted. So frames before the first points are left out. */
        const int is_early = since_ns < r->begin_s * 1e9 || (r->is_device && r->frame.bytes[1] != NATIVE_POINTS);
        if (!r->in_range && is_early) {
            replay_keep_front(&r->front, r->frame.bytes);
            if (r->times == 0) take_skipped_clock(r);
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
    r->position_ns = native_since_ns(r->frame.t_ns, r->first_ns);
    replay_note_frame(r, frame, tick);
    if (r->times == 1) replay_clock_take(&r->clock, frame, r->shift_ns);
    pthread_mutex_unlock(&r->lock);
}

/* Readers have not seen the frames that were skipped. So they get descriptor, emitter and anchor, like a reader that
 * joins late. After a jump in time these frames are sent without REPEAT, since earlier pulses of the same scan may
 * follow. A reader takes earlier pulses for those of another scan, unless a descriptor without REPEAT comes before. */
static void add_front(struct replay *r, uint64_t tick)
{
    uint8_t frame[REPLAY_FRONT_ROOM];
    const uint8_t flags = r->times > 1 ? NATIVE_LOCAL : NATIVE_REPEAT | NATIVE_LOCAL;
    for (int i = 0; i < REPLAY_FRONT; i++) {
        if (r->front.len[i] == 0) continue;
        memcpy(frame, r->front.bytes[i], r->front.len[i]);
        frame[3] = (uint8_t)((frame[3] & ~NATIVE_REPEAT) | flags);
        native_finish_frame(frame, 0);
        replay_add(r, frame, r->front.len[i], tick);
    }
}

/* ---- time */

/* Counts frames anew from this tick on: it is the first tick of a round, or of another head within the recording. */
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

/* Returns the tick with which the next frame goes out. */
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
    const double out = ceil(n / r->pace - 1e-9) - 1.0;
    return r->start_tick + (out < 0x1p62 ? (uint64_t)(out > 0.0 ? out : 0.0) : UINT64_C(1) << 62);
}

void replay_stop(struct replay *r, uint64_t tick, int wants_again)
{
    pthread_mutex_lock(&r->lock);
    r->playing = 0;
    r->wants_again = wants_again && r->loop;
    replay_set_state(r, tick, HEAD_IDLE);
    pthread_mutex_unlock(&r->lock);
}

/* Returns whether readers need descriptor, emitter and anchor before the first frame. If so, r->front has them. */
static int needs_front(struct replay *r)
{
    const uint8_t *frame = r->frame.bytes;
    if (r->has_skipped) return frame[1] != NATIVE_DESCRIPTOR || (r->times > 1 && (frame[3] & NATIVE_REPEAT) != 0);
    /* Where a recording begins within a scan, even its first descriptor is a repetition. */
    if (r->times == 1 || (r->first_front.bytes[0][3] & NATIVE_REPEAT) == 0) return 0;
    r->front = r->first_front;
    return 1;
}

/* A part (`--to`) may end later than its last frame: to seek its end is no failure. */
static int is_at_end(struct replay *r)
{
    const int is_end = r->begin_s > r->options.from_s && r->begin_s <= r->cmd.replay.length_s;
    if (!is_end) return 0;
    pthread_mutex_lock(&r->lock);
    r->position_ns = llround(1e9 * r->begin_s);
    pthread_mutex_unlock(&r->lock);
    return 1;
}

void replay_begin(struct replay *r, uint64_t tick)
{
    struct sh_err err = {0};
    if (r->end_tick == UINT64_MAX && r->options.duration_s > 0.0) r->end_tick = tick + r->n_ticks;
    r->has_frame = r->in_range = r->has_skipped = 0;
    if (recording_rewind(&r->recording, &err) != SH_OK) {
        replay_stop(r, tick, 0);
        replay_fail(r, &err);
        return;
    }
    const int found = replay_look(r);
    if (found <= 0) {
        const int plays_end = found == 0 && is_at_end(r);
        replay_stop(r, tick, plays_end);
        if (plays_end) return;
        sh_fail(&err, SH_EINPUT, "%s: it has no frame from %.10g s on", r->options.path, r->begin_s);
        if (found == 0) replay_fail(r, &err);
        return;
    }
    rebase(r, tick);
    r->in_range = 1;
    r->restarts = 1;
    pthread_mutex_lock(&r->lock);
    r->playing = 1;
    r->pace = r->speed;
    r->times++;
    r->position_ns = native_since_ns(r->frame.t_ns, r->first_ns);
    set_shift(r);
    if (r->times == 1) replay_clock_shift(&r->clock, r->shift_ns); /* so far it was that of the recording's times */
    replay_set_state(r, tick, HEAD_SCANNING);
    pthread_mutex_unlock(&r->lock);
    if (needs_front(r)) add_front(r, tick);
}

void replay_pace(struct replay *r, uint64_t tick)
{
    pthread_mutex_lock(&r->lock);
    r->pace = r->speed;
    pthread_mutex_unlock(&r->lock);
    if (replay_look(r) == 1) rebase(r, tick);
}

void replay_fill(struct replay *r, uint64_t tick, int may_skip)
{
    int found;
    while ((found = replay_look(r)) == 1) {
        const uint64_t due = due_tick(r, tick);
        if (due > tick && !(may_skip && r->len == 0)) return;
        if (due > tick) r->start_tick -= due - tick;           /* may wrap below 0: due_tick() wraps back */
        if (r->len + r->frame.len > REPLAY_MOST_BYTES) return; /* the rest comes with the next tick */
        set_shift(r);
        replay_add(r, r->frame.bytes, r->frame.len, tick);
        r->has_frame = 0;
    }
    replay_stop(r, tick, found == 0);
}
