/* Frames that a reader lost: counted here (reader_lost_frames), announced to the reader in an event of its
 * own, and reported to the error queue. Pulses that the head could not compute in time are another matter:
 * device/overrun.c. */
#include <stdio.h>

#include "drivers/protocol/native_encode.h"
#include "firmware_sim/loop/pump_inside.h"

void session_count_lost(struct pump *pump, struct session *s, uint32_t n)
{
    s->lost.frames += n;
    atomic_fetch_add(&pump->stream->counters->reader_lost_frames, n);
    if (!s->lost.lagging) {
        char text[96];
        snprintf(text, sizeof text, "session %u, %.50s", s->id, s->peer);
        device_report(pump->links->device, CMD_E_READER, text);
    }
    s->lost.lagging = 1;
}

/* Announces it to the reader in a frame of its own. */
static void announce(struct pump *pump, struct session *s, uint32_t frames)
{
    struct native_event event = {.code = NATIVE_EV_READER_LOST, .a = frames, .c = s->lost.frames};
    int64_t now_ns = (int64_t)stream_released(pump->stream) * pump->stream->tick_ns;
    snprintf(event.text, sizeof event.text, "%u frames lost: the reader is too slow", frames);
    s->out_len +=
        (uint32_t)native_encode_event(s->out + s->out_len, pump->out_cap - s->out_len, &event, now_ns, NATIVE_LOCAL);
}

void session_check_lost(struct pump *pump, struct session *s, const struct ring_copy *tick, uint64_t released)
{
    /* An empty tick has a number, too: the last frames for a long time may have been lost. */
    if (s->lost.have_seq && tick->first_seq != s->lost.next_seq) {
        uint32_t frames = tick->first_seq - s->lost.next_seq;
        session_count_lost(pump, s, frames);
        announce(pump, s, frames);
    } else if (released - s->cursor < pump->stream->ring.queue_ticks / 8) {
        s->lost.lagging = 0;
    }
    s->lost.have_seq |= tick->n_frames != 0;
    s->lost.next_seq = tick->first_seq + tick->n_frames;
}

void session_leave(struct pump *pump, struct session *s)
{
    struct stream *stream = pump->stream;
    uint32_t missing = s->lost.have_seq ? stream->seq - s->lost.next_seq : 0; /* the pacing thread is done with seq */
    if (pump->nmea) missing = pump_nmea_backlog(pump, s);
    if (s->out_pos < s->out_len) missing++; /* at least the frame it was in the middle of */
    if (atomic_load(&stream->over)) atomic_fetch_add(&stream->counters->reader_lost_frames, missing);
    stream_set_reader(stream, s->reader, s->cursor, 0);
}
