/* Faults on the wire: what a session would write goes through its wire (firmware_sim/fault/wire.h), and what comes out
 * of that is written. A session has a wire from the first fault on. Without one nothing of this is called.
 *
 * A wire that is held back keeps as much as a session's buffer. Then the session takes no more, and its reader is as any
 * reader that is too slow. What lies in the wire when the client goes away counts as written. */
#include "firmware_sim/base/clock.h"
#include "firmware_sim/loop/pump_inside.h"

#include <stdio.h>
#include <string.h>

static const int64_t NO_TIME = INT64_MAX;
static const int64_t AGAIN_NS = 100000000; /* between attempts to be there again */

int session_has_wire(struct pump *pump, struct session *s)
{
    if (s->wire != NULL) return 1;
    if (pump->board == NULL || fault_board_version(pump->board) == 0) return 0;
    const int native = pump->protocol->passes_native;
    const struct wire_spec spec = {
        .board = pump->board,
        .link = pump->number,
        .session = s->id,
        .max_unit = native ? NATIVE_MAX_FRAME : pump->protocol->max_unit,
        .units = !native,
        .native = native,
        .reseal = pump->protocol->reseal,
        .acts = pump->can,
        .tally = &pump->tally,
    };
    s->wire = wire_create(&spec);
    if (s->wire == NULL) device_report(pump->links->device, CMD_E_REFUSED, "no memory for the faults of a session");
    return s->wire != NULL;
}

void session_close_wire(struct session *s)
{
    wire_free(s->wire);
    s->wire = NULL;
}

int session_wire_waits(const struct session *s)
{
    return s->wire != NULL && !wire_is_empty(s->wire);
}

static void put(struct pump *pump, struct session *s, int of, const uint8_t *bytes, size_t len)
{
    const struct wire_item item = {.of = of,
                                   .bytes = bytes,
                                   .len = len,
                                   .t_ns = (int64_t)stream_released(pump->stream) * pump->stream->tick_ns};
    if (wire_put(s->wire, &item, clock_now_ns()) != SH_OK)
        device_report(pump->links->device, CMD_E_READER, "no memory for the faults of a session: a frame is lost");
}

/* Reply lines, each with its end. */
static void put_replies(struct pump *pump, struct session *s, const uint8_t *from, const uint8_t *to)
{
    while (from < to) {
        const uint8_t *end = memchr(from, '\n', (size_t)(to - from));
        const size_t len = end != NULL ? (size_t)(end + 1 - from) : (size_t)(to - from);
        put(pump, s, FAULT_OF_REPLIES, from, len);
        from += len;
    }
}

/* What lies in the session's buffer goes into its wire. */
static void take_over(struct pump *pump, struct session *s)
{
    put_replies(pump, s, s->out + s->out_pos, s->out + s->frames_from);
    for (uint32_t at = s->frames_from; at < s->frames_to;) {
        const size_t len = native_frame_len(s->out + at);
        put(pump, s, FAULT_OF_STREAM, s->out + at, len);
        at += (uint32_t)len;
    }
    put_replies(pump, s, s->out + s->frames_to, s->out + s->out_len);
    s->out_pos = s->out_len;
}

void session_put_unit(struct pump *pump, struct session *s, const uint8_t *unit, size_t len, int is_reply)
{
    put(pump, s, is_reply ? FAULT_OF_REPLIES : FAULT_OF_STREAM, unit, len);
}

void session_heard(struct session *s, const void *bytes, size_t len)
{
    if (s->wire != NULL) wire_heard(s->wire, bytes, len);
}

static int64_t in_ms(double ms)
{
    return clock_now_ns() + (int64_t)(ms * 1e6);
}

/* What ends by it: the session at hand, or all of the link. */
static void end_sessions(struct pump *pump, struct session *s, enum link_fault what)
{
    if (what == LINK_FAULT_DISCONNECT) session_close(pump, s);
    if (what != LINK_FAULT_UNPLUG && what != LINK_FAULT_BUS_RESET) return;
    for (int i = 0; i < LINK_MAX_SESSIONS; i++)
        session_close(pump, &pump->session[i]);
}

/* The act that is the first of the wire. Returns 1 when the session is over by it. */
static int carry_out(struct pump *pump, struct session *s, int index, const struct wire_piece *act)
{
    const enum fault_kind kind = (enum fault_kind)act->act;
    const enum link_fault what = pump_link_fault(kind);
    const double for_ms = act->for_ms;
    const int rc = pump->ops->fault(pump->link, what, index, act->n, for_ms);
    wire_pop(s->wire);
    if (what == LINK_FAULT_BUS_RESET) pump->plug_ns = in_ms(0.0); /* where it takes unplugging, and plugging in fails */
    if (rc != SH_OK) {
        char text[96];
        snprintf(text, sizeof text, "the fault %s could not be carried out now", fault_names[kind]);
        pump_say(pump, text);
        return 0;
    }
    if (what == LINK_FAULT_UNPLUG) pump->plug_ns = in_ms(for_ms);
    if (what == LINK_FAULT_DISCONNECT && for_ms > 0.0) pump->refuse_until_ns = in_ms(for_ms);
    end_sessions(pump, s, what);
    return !s->open;
}

int session_write_wire(struct pump *pump, struct session *s, int index)
{
    for (;;) {
        struct wire_piece *piece = wire_due(s->wire, clock_now_ns(), atomic_load(&pump->stream->over));
        if (piece == NULL) return 0;
        if (piece->kind == WIRE_ACT) {
            if (carry_out(pump, s, index, piece)) return -1;
            continue;
        }
        const ssize_t n = pump->ops->write(pump->link, index, piece->bytes + piece->out, piece->len - piece->out);
        if (n == 0) return 1;
        if (n < 0) {
            if (n != SH_ECLOSED) pump->failed = 1; /* the reason comes with LINK_CLOSED */
            session_close(pump, s);
            return -1;
        }
        piece->out += (size_t)n;
        s->moved_ns = clock_now_ns();
        if (piece->out == piece->len) wire_pop(s->wire);
    }
}

int session_write_faulty(struct pump *pump, struct session *s, int index)
{
    if (s->out_pos < s->out_len) take_over(pump, s);
    for (;;) {
        int full = session_write_wire(pump, s, index);
        if (full < 0) return 0;
        if (full || wire_bytes(s->wire) >= pump->out_cap) return full;
        session_fill(pump, s);
        if (s->out_pos == s->out_len) return 0;
        take_over(pump, s);
    }
}

int64_t pump_next_ns(const struct pump *pump)
{
    const int64_t now_ns = clock_now_ns();
    int64_t next_ns = pump->plug_ns != 0 ? pump->plug_ns : NO_TIME;
    for (int i = 0; i < LINK_MAX_SESSIONS; i++) {
        const struct session *s = &pump->session[i];
        if (!s->open || s->wire == NULL) continue;
        const int64_t due_ns = wire_next_ns(s->wire); /* what is due already waits for the link */
        if (due_ns > now_ns && due_ns < next_ns) next_ns = due_ns;
    }
    return next_ns;
}

void pump_plug(struct pump *pump)
{
    if (pump->plug_ns == 0 || clock_now_ns() < pump->plug_ns) return;
    if (pump->ops->fault(pump->link, LINK_FAULT_PLUG, 0, 0, 0.0) == SH_OK) {
        if (pump->plug_failed) pump_say(pump, "is there again");
        pump->plug_ns = pump->plug_failed = 0;
        return;
    }
    if (!pump->plug_failed)
        pump_say(pump, "was unplugged on request, and somebody else has its endpoint now; tries until it is free");
    pump->plug_failed = 1;
    pump->plug_ns = clock_now_ns() + AGAIN_NS;
}
