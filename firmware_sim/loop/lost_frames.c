/* SPDX-License-Identifier: MIT */
/* Frames that a reader lost: counted here (reader_lost_frames), and reported to the error queue. A reader of the native
 * stream gets an event of its own about them. Losses of a part of this program, such as the page's observer, are no
 * client's: only the counts of its link have them. Pulses that the head could not compute in time are in
 * device/overrun.c. */
#include <stdio.h>
#include <string.h>

#include "drivers/protocol/native_encode.h"
#include "firmware_sim/loop/pump_inside.h"

static void count_lost_of_clients(struct pump *pump, uint64_t frames, uint64_t pulses)
{
    if (pump->is_own) return;
    atomic_fetch_add(&pump->stream->counters->reader_lost_frames, frames);
    atomic_fetch_add(&pump->stream->counters->reader_lost_pulses, pulses);
}

static void count_lost(struct pump *pump, uint32_t n, uint64_t pulses)
{
    pump->counts.left_out_frames += n;
    pump->counts.left_out_pulses += pulses;
    count_lost_of_clients(pump, n, pulses);
}

/* Reports a loss of the session to the error queue; the next one only after its reader has caught up. */
static void lost_frames_report(struct pump *pump, struct session *s)
{
    if (!s->lost.lagging && !pump->is_own) {
        char text[96];
        snprintf(text, sizeof text, "session %u, %.50s", s->id, s->peer);
        source_report(pump->links->source, CMD_E_READER, text);
    }
    s->lost.lagging = 1;
}

void session_count_units(struct pump *pump, struct session *s, uint64_t n)
{
    pump->counts.lost_units += n;
    count_lost_of_clients(pump, n, 0);
    lost_frames_report(pump, s);
}

/* Announces the loss to the reader in a frame of its own. The tick's frames move back to make room before them. */
static void announce(struct pump *pump, struct session *s, const struct ring_copy *tick, uint32_t frames,
                     uint64_t pulses)
{
    uint8_t said[REPLY_ROOM / 8];
    struct native_event event = {.code = NATIVE_EV_READER_LOST, .a = frames, .b = pulses, .c = s->lost.frames};
    int64_t now_ns = (int64_t)stream_released(pump->stream) * pump->stream->tick_ns;
    snprintf(event.text, sizeof event.text, "%u frames lost: the reader is too slow", frames);
    const size_t len = native_encode_event(said, sizeof said, &event, now_ns, NATIVE_LOCAL);
    memmove(tick->buf + len, tick->buf, tick->len);
    memcpy(tick->buf, said, len);
    s->out_len += (uint32_t)len;
}

uint32_t session_check_lost(struct pump *pump, struct session *s, const struct ring_copy *tick, uint64_t released)
{
    uint32_t frames = 0;
    /* An empty tick has the number of the next frame, so it shows a loss, too. That frame may come much later. */
    if (s->lost.have_seq && tick->first_seq != s->lost.next_seq) {
        uint64_t pulses = tick->pulses_before - s->lost.next_pulse;
        frames = tick->first_seq - s->lost.next_seq;
        s->lost.frames += frames;
        count_lost(pump, frames, pulses);
        lost_frames_report(pump, s);
        if (pump->protocol->passes_native) announce(pump, s, tick, frames, pulses);
    } else if (released - s->cursor <= 1 + pump->stream->ring.queue_ticks / 8 && s->units.n == 0) {
        s->lost.lagging = 0;
    }
    s->lost.have_seq = 1;
    s->lost.next_seq = tick->first_seq + tick->n_frames;
    s->lost.next_pulse = tick->pulses_before + tick->n_cast;
    if (s->cursor >= s->came_at) pump->counts.received_pulses += tick->n_cast;
    return frames;
}

/* Ticks that the head itself lost have no frames and no numbers. So the last tick before them says which number comes
 * next. */
void session_know_next(struct pump *pump, struct session *s)
{
    struct ring *ring = &pump->stream->ring;
    struct ring_copy tick = {.first_seq = pump->stream->first_seq};
    enum ring_read got = RING_LOST;
    for (uint64_t at = s->cursor; at != 0 && s->cursor - at < ring->queue_ticks && got == RING_LOST; at--) {
        got = ring_look(ring, s->reader, at - 1, &tick);
        ring_leave(ring, s->reader);
    }
    s->lost.have_seq = s->cursor == 0 || got == RING_READ;
    if (!s->lost.have_seq) return;
    s->lost.next_seq = tick.first_seq + tick.n_frames;
    s->lost.next_pulse = tick.pulses_before + tick.n_cast;
}

/* Frames are rare where nothing is scanned, and empty ticks wake nobody. So the ring may no longer have the ticks that
 * a session has not taken, and yet none of them had a frame. */
void session_catch_up(struct pump *pump, struct session *s, uint64_t released, uint64_t power_tick)
{
    struct ring *ring = &pump->stream->ring;
    struct ring_copy tick = {.buf = NULL};
    const uint64_t oldest = released - ring->queue_ticks;
    const int is_whole = s->lost.have_seq && ring_look(ring, s->reader, oldest, &tick) == RING_READ &&
                         tick.first_seq == s->lost.next_seq;
    ring_leave(ring, s->reader);
    s->cursor = is_whole ? oldest : released - ring->queue_ticks / 2; /* half a queue of room to recover */
    if (s->cursor > power_tick) s->cursor = power_tick;
}

/* Frames of the stream, and pulses in them, that are in the session's buffer and were not written as a whole.
 * Reply lines lie between frames; they have no byte that begins a frame. */
static uint32_t count_unwritten(const struct session *s, uint64_t *pulses)
{
    uint32_t frames = 0;
    *pulses = 0;
    for (uint32_t at = 0; at < s->out_len;) {
        const uint8_t *frame = s->out + at;
        struct native_header header;
        struct native_points points;
        if (frame[0] != NATIVE_SYNC) {
            at++;
            continue;
        }
        native_read_header(frame, &header);
        at += (uint32_t)native_frame_len(frame);
        if (at <= s->out_pos || (header.flags & NATIVE_LOCAL) != 0) continue;
        frames++;
        if (header.type == NATIVE_POINTS &&
            native_decode_points(frame + NATIVE_HEADER_LEN, header.length, &points) == SH_OK)
            *pulses += points.n_pulses;
    }
    return frames;
}

/* When a session is gone, its frames that the ring no longer has are counted as lost. The number of the next tick's
 * frames would show them, but nobody takes that tick any more. */
static void count_overtaken(struct pump *pump, struct session *s)
{
    struct ring *ring = &pump->stream->ring;
    const uint64_t released = stream_released(pump->stream);
    struct ring_copy tick;
    if (!s->lost.have_seq || released - s->cursor <= ring->queue_ticks) return;
    enum ring_read got = RING_LOST;
    for (uint64_t at = released - ring->queue_ticks; at < released && got == RING_LOST; at++) {
        got = ring_look(ring, s->reader, at, &tick);
        ring_leave(ring, s->reader);
    }
    if (got != RING_READ || tick.first_seq == s->lost.next_seq) return;
    count_lost(pump, tick.first_seq - s->lost.next_seq, tick.pulses_before - s->lost.next_pulse);
    lost_frames_report(pump, s);
}

void session_gone(struct pump *pump, struct session *s)
{
    uint64_t pulses = 0;
    count_overtaken(pump, s);
    const int native = pump->protocol->passes_native;
    const struct faulty_unwritten in_link = faulty_forget(pump->link, session_index(pump, s));
    if (native) count_unwritten(s, &pulses);
    pump->counts.received_pulses -= pulses + in_link.pulses; /* counted as received when the link took them */
    if (!native) pump->counts.sent_units -= in_link.frames;
}

void session_leave(struct pump *pump, struct session *s)
{
    struct stream *stream = pump->stream;
    uint64_t pulses = 0, unwritten = 0;
    uint32_t frames = 0;
    const int native = pump->protocol->passes_native, over = atomic_load(&stream->over);
    const struct faulty_unwritten in_link = faulty_forget(pump->link, session_index(pump, s));
    if (s->lost.have_seq && native) frames = count_unwritten(s, &unwritten);
    if (s->lost.have_seq && over) { /* now the pacing thread no longer changes seq */
        frames += stream->seq - s->lost.next_seq;
        pulses = unwritten + atomic_load(&stream->counters->pulses) - s->lost.next_pulse;
    }
    pump->counts.received_pulses -= unwritten + in_link.pulses;
    if (over) count_lost(pump, frames + (native ? (uint32_t)in_link.frames : 0), pulses + in_link.pulses);
    if (!native) pump->counts.sent_units -= in_link.frames;
    const uint64_t units = native ? 0 : s->units.n + in_link.frames;
    if (over && units != 0) session_count_units(pump, s, units);
    stream_set_reader(stream, s->reader, s->cursor, 0);
    if (!native) session_close_protocol(pump, s);
}
