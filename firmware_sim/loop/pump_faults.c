/* SPDX-License-Identifier: MIT */
/* Injected faults on the wire: a session's bytes go through its wire (firmware_sim/fault/wire.h) before they are
 * written. A session has a wire from the first fault on. Without one nothing of this is called.
 *
 * A wire that stalls holds as many bytes as a session's buffer; one that delays holds WIRE_DELAY_BYTES. Once it is full
 * the session takes no more, and its reader counts as too slow. Bytes in the wire when the client goes away, or at the
 * end of the run, count as not written. Frames that a fault dropped or changed count as written. */
#include "firmware_sim/base/clock.h"
#include "firmware_sim/loop/pump_inside.h"

#include <stdio.h>
#include <string.h>

static const int64_t NO_TIME = INT64_MAX;
static const int64_t AGAIN_NS = 100000000; /* between attempts to plug the link in again */

/* Reply lines that are not in the wire yet. */
static uint32_t count_replies(const struct session *s)
{
    const struct session_commands *c = &s->commands;
    uint32_t n = (uint32_t)(c->stepping + c->moving);
    for (uint32_t i = 0; i < c->reply_len; i++)
        n += c->reply[i] == '\n';
    for (uint32_t i = s->out_pos; i < s->out_len; i++)
        n += s->out[i] == '\n' && (i < s->frames_from || i >= s->frames_to);
    return n;
}

/* A new wire gets what was read and not answered before it was made. */
static void hear_again(struct session *s)
{
    const struct session_commands *c = &s->commands;
    wire_skip_heard(s->wire, count_replies(s));
    wire_heard(s->wire, c->lines.buf, c->lines.len);
    wire_heard(s->wire, c->in + c->in_pos, c->in_len - c->in_pos);
}

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
        .datagrams = pump->ops->datagrams,
        .content = pump->protocol->content,
        .reseal = pump->protocol->reseal,
        .acts = pump->can,
        .tally = &pump->tally,
    };
    s->wire = wire_create(&spec);
    if (s->wire == NULL) source_report(pump->links->source, CMD_E_REFUSED, "no memory for the faults of a session");
    if (s->wire != NULL && native) hear_again(s);
    return s->wire != NULL;
}

void session_faults_changed(struct pump *pump, struct session *s)
{
    const int had = s->wire != NULL;
    if (!session_has_wire(pump, s)) return;
    if (!had) wire_skip_heard(s->wire, 1); /* the line itself */
    wire_renew(s->wire, count_replies(s) + 1);
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

int session_wire_keeps_back(const struct session *s, int64_t now_ns)
{
    return s->wire != NULL && wire_keeps_back(s->wire, now_ns);
}

int session_waits_for_files(const struct pump *pump, const struct session *s)
{
    const struct loop_source *source = pump->links->source;
    return pump->stream->waits && s->wire != NULL && !atomic_load(&pump->stream->over) &&
           !atomic_load(&pump->stream->ending) && source->ops->files_fill(source->self);
}

static void put(struct pump *pump, struct session *s, int of, const uint8_t *bytes, size_t len, uint64_t tick)
{
    const struct wire_item item = {.of = of, .bytes = bytes, .len = len, .t_ns = (int64_t)tick * pump->stream->tick_ns};
    if (wire_put(s->wire, &item, clock_now_ns()) != SH_OK)
        source_report(pump->links->source, CMD_E_READER, "no memory for the faults of a session: a frame is lost");
}

static void put_rest(struct pump *pump, struct session *s, const uint8_t *bytes, size_t len)
{
    if (wire_put_rest(s->wire, bytes, len) != SH_OK)
        source_report(pump->links->source, CMD_E_READER, "no memory for the faults of a session: a frame is lost");
}

/* Puts a frame or a reply of the session's buffer into the wire. Bytes of it that were written before there was a wire
 * are not written again. */
static void take_item(struct pump *pump, struct session *s, int of, uint32_t at, uint32_t end)
{
    if (at >= s->out_pos)
        put(pump, s, of, s->out + at, end - at, stream_released(pump->stream));
    else if (end > s->out_pos)
        put_rest(pump, s, s->out + s->out_pos, end - s->out_pos);
}

/* Puts reply lines into the wire, each with its end. */
static void take_replies(struct pump *pump, struct session *s, uint32_t at, uint32_t to)
{
    while (at < to) {
        const uint8_t *line = memchr(s->out + at, '\n', to - at);
        const uint32_t end = line != NULL ? (uint32_t)(line + 1 - s->out) : to;
        take_item(pump, s, FAULT_OF_REPLIES, at, end);
        at = end;
    }
}

/* Moves the session's buffer into its wire. */
static void take_over(struct pump *pump, struct session *s)
{
    take_replies(pump, s, 0, s->frames_from);
    for (uint32_t at = s->frames_from, end; at < s->frames_to; at = end) {
        end = at + (uint32_t)native_frame_len(s->out + at);
        take_item(pump, s, FAULT_OF_STREAM, at, end);
    }
    take_replies(pump, s, s->frames_to, s->out_len);
    s->out_pos = s->out_len;
}

void session_put_unit(struct pump *pump, struct session *s)
{
    size_t len;
    const struct unit_kind kind = unit_queue_kind(&s->units);
    const uint8_t *unit = unit_queue_next(&s->units, &len);
    if (s->units.out != 0)
        put_rest(pump, s, unit, len);
    else
        put(pump, s, kind.is_reply ? FAULT_OF_REPLIES : FAULT_OF_STREAM, unit, len, kind.made_tick);
}

void session_heard(struct session *s, const void *bytes, size_t len)
{
    if (s->wire != NULL) wire_heard(s->wire, bytes, len);
}

static int64_t in_ms(double ms)
{
    return clock_now_ns() + (int64_t)(ms * 1e6);
}

/* Closes the sessions that an act ends: this one, or all of the link. */
static void end_sessions(struct pump *pump, struct session *s, enum link_fault what)
{
    if (what == LINK_FAULT_DISCONNECT) session_close(pump, s);
    if (what != LINK_FAULT_UNPLUG && what != LINK_FAULT_BUS_RESET) return;
    for (int i = 0; i < LINK_MAX_SESSIONS; i++)
        session_close(pump, &pump->session[i]);
}

/* Carries out the act that is first in the wire. Returns 1 when that ended the session. */
static int carry_out(struct pump *pump, struct session *s, int index, const struct wire_piece *act)
{
    const enum fault_kind kind = (enum fault_kind)act->act;
    const enum link_fault what = pump_link_fault(kind);
    const double for_ms = act->for_ms;
    const struct fault_note note = *wire_act_note(act);
    const int rc = pump->ops->fault(pump->link, what, index, act->n, for_ms);
    wire_pop(s->wire);
    if (what == LINK_FAULT_BUS_RESET) pump->plug_ns = in_ms(0.0); /* a reset may unplug, and fail to plug in again */
    if (rc != SH_OK) {
        wire_go_on(s->wire);
        char text[96];
        snprintf(text, sizeof text, "the fault %s could not be carried out now", fault_names[kind]);
        pump_say(pump, text);
        return 0;
    }
    fault_board_note(pump->board, &note);
    if (what == LINK_FAULT_UNPLUG) pump->plug_ns = in_ms(for_ms);
    if (what == LINK_FAULT_DISCONNECT && for_ms > 0.0) pump->refuse_until_ns = in_ms(for_ms);
    end_sessions(pump, s, what);
    return !s->open;
}

int session_write_wire(struct pump *pump, struct session *s, int index, int last)
{
    for (;;) {
        struct wire_piece *piece = wire_due(s->wire, clock_now_ns(), last);
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

int session_wire_is_full(const struct pump *pump, const struct session *s)
{
    return wire_is_full(s->wire, pump->out_cap, clock_now_ns());
}

int session_write_faulty(struct pump *pump, struct session *s, int index)
{
    if (s->out_pos < s->out_len) take_over(pump, s);
    for (int last = 0;;) {
        const int full = session_write_wire(pump, s, index, last);
        if (full < 0) return 0;
        if (full || last || session_wire_is_full(pump, s)) return full;
        const int over = atomic_load(&pump->stream->over);
        session_fill(pump, s);
        last = over && s->out_pos == s->out_len; /* nothing more comes, so nothing waits for it */
        if (s->out_pos < s->out_len)
            take_over(pump, s);
        else if (!last)
            break;
        wire_time(s->wire, (int64_t)s->cursor * pump->stream->tick_ns);
    }
    wire_time(s->wire, (int64_t)s->cursor * pump->stream->tick_ns);
    stream_note_written(pump->stream, s->reader, s->cursor); /* bytes that a fault holds back hold up nobody */
    return 0;
}

int64_t pump_next_ns(const struct pump *pump)
{
    const int64_t now_ns = clock_now_ns();
    int64_t next_ns = pump->plug_ns != 0 ? pump->plug_ns : NO_TIME;
    for (int i = 0; i < LINK_MAX_SESSIONS; i++) {
        const struct session *s = &pump->session[i];
        if (!s->open || s->wire == NULL) continue;
        const int64_t due_ns = wire_next_ns(s->wire); /* a time in the past: that piece waits for the link */
        if (due_ns > now_ns && due_ns < next_ns) next_ns = due_ns;
        if (session_waits_for_files(pump, s) && now_ns + STREAM_FILES_NS < next_ns) next_ns = now_ns + STREAM_FILES_NS;
    }
    return next_ns;
}

void pump_plug(struct pump *pump)
{
    if (pump->plug_ns == 0 || clock_now_ns() < pump->plug_ns) return;
    if (pump->ops->fault(pump->link, LINK_FAULT_PLUG, 0, 0, 0.0) == SH_OK) {
        if (pump->plug_failed) pump_say(pump, "is plugged in again");
        pump->plug_ns = pump->plug_failed = 0;
        return;
    }
    if (!pump->plug_failed)
        pump_say(
            pump,
            "was unplugged on request, and another program has its endpoint now; it tries again until that is free");
    pump->plug_failed = 1;
    pump->plug_ns = clock_now_ns() + AGAIN_NS;
}
