/* SPDX-License-Identifier: MIT */
/* Takes settings, states and counts from the frames, for commands and statistics. */
#include "firmware_sim/replay/replay_state.h"

static void note_event(struct replay *r, const uint8_t *frame, uint64_t tick)
{
    struct native_event event;
    if (native_decode_event(frame + NATIVE_HEADER_LEN, native_frame_len(frame) - NATIVE_HEADER_LEN, &event) != SH_OK)
        return;
    /* With another protocol than the native one, the head scans while the recording plays, whatever its states say. */
    const int has_state = event.code == NATIVE_EV_STATE && !r->is_device;
    if (has_state && event.a < HEAD_N_STATES) replay_set_state(r, tick, (enum head_state)event.a);
    if (event.code == NATIVE_EV_SCAN_START) {
        r->scans++;
        r->frames_done = 0;
    }
}

static void count_points(struct replay *r, const uint8_t *payload, size_t len)
{
    struct native_points points;
    uint32_t empty, with_reflectance;
    if (native_decode_points(payload, len, &points) != SH_OK) return;
    r->tick.n_cast += points.n_pulses;
    r->tick.n_fired += points.n_pulses;
    native_count_points(payload, points.n_points, &empty, &with_reflectance);
    r->tick.hits.echoes += points.n_points - empty;
    r->tick.hits.empty += empty;
}

static void count_line(struct replay *r, const uint8_t *payload, size_t len)
{
    struct line_end end;
    if (native_decode_line_end(payload, len, &end) != SH_OK) return;
    r->tick.n_lines++;
    if (end.n_fired > end.n_cast) r->tick.n_fired += end.n_fired - end.n_cast; /* cast ones are counted already */
    r->tick.hits.crowded += end.n_crowded;
    r->tick.hits.faint += end.n_faint;
    r->tick.hits.unfit += end.n_unfit;
    if ((end.status & LINE_LAST_OF_FRAME) != 0) r->frames_done = end.frame + (uint64_t)1;
}

void replay_note_frame(struct replay *r, const uint8_t *frame, uint64_t tick)
{
    const uint8_t *payload = frame + NATIVE_HEADER_LEN;
    const size_t len = native_frame_len(frame) - NATIVE_HEADER_LEN;
    struct native_descriptor d;
    struct native_emitter e;
    struct native_anchor a;
    if (frame[1] == NATIVE_POINTS) count_points(r, payload, len);
    if (frame[1] == NATIVE_LINE_END) count_line(r, payload, len);
    if (frame[1] == NATIVE_EVENT) note_event(r, frame, tick);
    if (frame[1] == NATIVE_DESCRIPTOR && native_decode_descriptor(payload, len, &d) == SH_OK)
        replay_take_descriptor(r, &d);
    if (frame[1] == NATIVE_EMITTER && native_decode_emitter(payload, len, &e) == SH_OK) replay_take_emitter(r, &e);
    if (frame[1] == NATIVE_ANCHOR && native_decode_anchor(payload, len, &a) == SH_OK) replay_take_anchor(r, &a);
    if (frame[1] == NATIVE_POINTS) r->tick.scan = (uint32_t)r->scans;
    r->frames++;
}
