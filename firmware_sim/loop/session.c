/* SPDX-License-Identifier: MIT */
/* A session of a link: takes ticks from the stream into a buffer of its own, and writes that to the link.
 *
 * If the link's write() never waits, long ticks are written straight from the ring. If write() is cheap, too, all ticks
 * are written so. Other ticks, and bytes that the link did not take, are copied first. So a slow reader
 * holds up nobody. A session whose next tick is no longer in the ring loses whole frames, and goes on with newer ones
 * (lost_frames.c). */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "drivers/link/memory.h"
#include "firmware_sim/base/clock.h"
#include "firmware_sim/loop/pump_inside.h"

enum { STRAIGHT_BYTES = 16384 }; /* a tick this long is worth a system call of its own */
enum { LENT_TICKS = 8 };         /* the ring has so many slots beyond those that it needs */
_Static_assert((int)BATCH_BYTES / (int)STRAIGHT_BYTES <= (int)LENT_TICKS && (int)MEMORY_PIECES > (int)LENT_TICKS,
               "ticks that are lent in one turn");

static void clear(struct session *s)
{
    struct session_commands *c = &s->commands;
    memset(&s->lost, 0, sizeof s->lost);
    s->out_len = s->out_pos = s->frames_from = s->frames_to = 0;
    c->reply_len = c->in_len = c->in_pos = 0;
    c->stepping = c->moving = c->replies_dropped = 0;
    c->wrong = 0;
    memset(&c->lines, 0, sizeof c->lines);
}

static void tell_observer(const struct pump *pump, const struct session *s, int begins)
{
    const struct links_observer *observer = pump->links->observer;
    const int64_t t_ns = (int64_t)s->cursor * pump->stream->tick_ns;
    if (observer != NULL) observer->session(observer->ctx, s->id, begins, s->peer, t_ns);
}

void session_open(struct pump *pump, struct session *s, const char *peer)
{
    const int native = pump->protocol->passes_native;
    clear(s);
    s->moved_ns = clock_now_ns();
    /* In the paces that wait, the pacing thread is from here on ahead of this reader by the queue's length at most. The
     * cursor is set after that, so its tick stays in the ring. */
    stream_set_reader(pump->stream, s->reader, stream_released(pump->stream), pump->holds);
    s->cursor = stream_released(pump->stream);
    s->power_from = s->came_at = 0;
    s->shut = s->left = s->is_off = 0;
    snprintf(s->peer, sizeof s->peer, "%.63s", peer); /* an address is shorter */
    if (native && s->out == NULL) s->out = malloc(pump->out_cap);
    struct sh_err err = {.text = "no memory for a session"};
    if (native ? s->out == NULL : session_open_protocol(pump, s, &err) != SH_OK) {
        source_report(pump->links->source, CMD_E_REFUSED, err.text);
        if (pump->ops->end != NULL) pump->ops->end(pump->link, session_index(pump, s));
        stream_set_reader(pump->stream, s->reader, s->cursor, 0);
        return;
    }
    s->open = 1;
    session_know_next(pump, s);
    stream_set_reader(pump->stream, s->reader, s->cursor, pump->holds);
    const struct loop_source *source = pump->links->source;
    char who[COMMAND_PEER_LEN];
    snprintf(who, sizeof who, "%s %s", pump->ops->name, s->peer);
    source->ops->session_opened(source->self, s->id, who);
    tell_observer(pump, s, 1);
    stream_poke(pump->stream);
}

void session_cut(struct pump *pump, struct session *s)
{
    const struct loop_source *source = pump->links->source;
    s->open = 0;
    if (source->ops->session_over != NULL) source->ops->session_over(source->self);
    tell_observer(pump, s, 0);
    session_gone(pump, s);
    stream_set_reader(pump->stream, s->reader, s->cursor, 0);
    if (!pump->protocol->passes_native) session_close_protocol(pump, s);
}

void session_power_off(struct pump *pump, struct session *s, uint64_t tick)
{
    s->power_from = tick + 1;
    if (pump->protocol->passes_native) return;
    clear(s);
    session_gone(pump, s); /* units that still wait in the link are not sent */
    session_close_protocol(pump, s);
    s->is_off = 1;
    s->moved_ns = clock_now_ns(); /* the link has forgotten when it last moved, and at the run's end it is waited for */
}

void session_power_on(struct pump *pump, struct session *s, uint64_t tick)
{
    if (!s->is_off) return;
    s->is_off = 0;
    s->moved_ns = clock_now_ns();
    if (s->cursor < tick) s->cursor = tick; /* in real time, a link that takes no more; these ticks went with power */
    if (session_reopen_protocol(pump, s) == SH_OK) {
        session_know_next(pump, s);
        return;
    }
    source_report(pump->links->source, CMD_E_REFUSED, "no memory for a session");
    session_cut(pump, s);
    if (pump->ops->end != NULL) pump->ops->end(pump->link, session_index(pump, s));
}

uint64_t session_power_tick(const struct pump *pump, const struct session *s)
{
    if (pump->is_clean) return UINT64_MAX;
    const uint64_t from = s->cursor > s->power_from ? s->cursor : s->power_from;
    return s->is_off ? stream_on_tick(pump->stream, from) : stream_off_tick(pump->stream, from);
}

/* The session sends no more commands: gives its control back, once. */
static void leave(struct pump *pump, struct session *s)
{
    const struct command_lines *lines = &s->commands.lines;
    const struct loop_source *source = pump->links->source;
    if (!pump->protocol->passes_native || s->left) return; /* other protocols never keep control */
    s->left = 1;
    source->ops->session_closed(source->self, s->id, s->peer, lines->len != 0 || lines->overrun);
    stream_poke(pump->stream);
}

void session_close(struct pump *pump, struct session *s)
{
    if (!s->open) return;
    if (pump->protocol->gone != NULL && !s->is_off) pump->protocol->gone(s->protocol);
    session_cut(pump, s);
    leave(pump, s);
}

/* The session leaves only after its lines that wait for a step, a move or room are carried out. */
static void leave_when_done(struct pump *pump, struct session *s)
{
    const struct session_commands *c = &s->commands;
    if (s->shut && !s->left && c->in_pos == c->in_len && !c->stepping && !c->moving) leave(pump, s);
}

void session_shut(struct pump *pump, struct session *s)
{
    s->shut = 1;
    if (s->open) leave_when_done(pump, s);
}

/* Whether something is still due to the client. In the native protocol replies are due, and so is the stream up to the
 * tick at which the head begins to wait for a command. */
static int owes(const struct pump *pump, const struct session *s)
{
    const struct loop_source *source = pump->links->source;
    if (!pump->protocol->passes_native) return session_owes_protocol(pump, s);
    return !s->left || s->commands.reply_len != 0 || s->out_pos != s->out_len ||
           s->cursor < source->ops->rests_from(source->self);
}

int session_is_done(const struct pump *pump, const struct session *s)
{
    if (pump->ops->end == NULL || session_waits(pump, s)) return 0;
    return s->hang_up || (s->shut && !owes(pump, s));
}

/* Puts one tick into the buffer. Returns 0 when there is none or no room. */
static int take_tick(struct pump *pump, struct session *s)
{
    struct ring *ring = &pump->stream->ring;
    uint32_t end = s->out_len + REPLY_ROOM / 8; /* leaves room for an event that announces a loss */
    if (end >= pump->out_cap || session_waits_for_files(pump)) return 0;
    struct ring_copy tick = {.buf = s->out + s->out_len, .cap = pump->out_cap - end};
    enum ring_read got = ring_read(ring, s->reader, s->cursor, &tick);
    /* After ring_read: where power goes with a tick, that is noted before the tick is released. */
    const uint64_t power_tick = session_power_tick(pump, s);
    if (s->cursor >= power_tick) return 0;
    if (got == RING_NONE || (got == RING_READ && tick.len > tick.cap)) return 0;
    uint64_t released = stream_released(pump->stream);
    if (got == RING_LOST && s->cursor + ring->queue_ticks < released) {
        session_catch_up(pump, s, released, power_tick);
        return 1;
    }
    s->cursor++;
    if (got != RING_READ) return 1;
    session_check_lost(pump, s, &tick, released);
    s->out_len += tick.len;
    return 1;
}

/* Keeps the bytes of a tick that a link did not take. The kept bytes begin with a whole frame, as count_unwritten
 * expects. */
static void keep_rest(struct session *s, const struct ring_copy *tick, uint32_t taken)
{
    uint32_t at = 0, len;
    while (at + (len = (uint32_t)native_frame_len(tick->buf + at)) <= taken)
        at += len;
    memcpy(s->out, tick->buf + at, tick->len - at);
    s->out_len = tick->len - at;
    s->out_pos = taken - at;
}

static int follows(const struct session *s, const struct ring_copy *tick)
{
    return !s->lost.have_seq || tick->first_seq == s->lost.next_seq;
}

/* Returns whether ticks are lent to the link: it reads them in the ring even after lend() has returned. In the paces
 * that wait for this reader, the ring still has the last LENT_TICKS before its cursor. */
static int lends(const struct pump *pump)
{
    return pump->ops->lend != NULL && pump->holds && pump->stream->waits;
}

/* Writes the next tick without a copy. Returns its bytes, or 0: there is no such tick, or the buffer has bytes that go
 * before the next one. */
static uint32_t write_straight(struct pump *pump, struct session *s)
{
    struct ring *ring = &pump->stream->ring;
    struct ring_copy tick;
    uint32_t taken = 0;
    const uint32_t least = pump->ops->is_cheap ? 1 : STRAIGHT_BYTES;
    if (s->out_len != 0 || pump->ops->stalls || session_waits_for_files(pump)) return 0;
    if (ring_look(ring, s->reader, s->cursor, &tick) == RING_READ && tick.len >= least && follows(s, &tick) &&
        s->cursor < session_power_tick(pump, s)) {
        session_check_lost(pump, s, &tick, stream_released(pump->stream));
        s->cursor++;
        const ssize_t n =
            (lends(pump) ? pump->ops->lend : pump->ops->write)(pump->link, session_index(pump, s), tick.buf, tick.len);
        taken = n > 0 ? (uint32_t)n : 0;
        if (taken < tick.len) keep_rest(s, &tick, taken);
        taken = taken == tick.len ? taken : 0;
    }
    ring_leave(ring, s->reader);
    return taken;
}

/* Puts the replies into the buffer; without room for them, they come next time. */
static void take_replies(struct pump *pump, struct session *s)
{
    struct session_commands *c = &s->commands;
    if (c->reply_len > pump->out_cap - s->out_len) return;
    memcpy(s->out + s->out_len, c->reply, c->reply_len);
    s->out_len += c->reply_len;
    c->reply_len = 0;
}

/* The frames of a step go out on all links before its reply: when a client has the reply, they are in each client's
 * socket. */
static int has_stepped(const struct pump *pump, const struct session *s)
{
    const uint64_t tick = s->commands.step_tick;
    if (atomic_load(&pump->stream->over)) return 1;
    return s->cursor >= tick && stream_has_written(pump->stream, pump->listener, s->reader, tick);
}

/* Writes long ticks, then puts the next ticks and replies into the buffer, which was written out. Where ticks were
 * lent, the cursor goes on by LENT_TICKS at most, empty ticks included. */
static void session_fill(struct pump *pump, struct session *s)
{
    struct session_commands *c = &s->commands;
    s->out_len = s->out_pos = 0;
    take_replies(pump, s);
    s->frames_from = s->out_len;
    const uint64_t end = lends(pump) ? s->cursor + LENT_TICKS : UINT64_MAX;
    uint32_t straight = 0;
    for (uint32_t n; straight < BATCH_BYTES && (n = write_straight(pump, s)) != 0; straight += n)
        stream_move_reader(pump->stream, s->reader, s->cursor);
    while (straight + s->out_len < BATCH_BYTES && (straight == 0 || s->cursor < end) && take_tick(pump, s))
        continue;
    s->frames_to = s->out_len;
    while (c->stepping && has_stepped(pump, s)) {
        c->stepping = 0;
        pump_add_reply(s, c->step_reply);
        pump_take_lines(pump, s);
    }
    pump_end_move(pump, s);
    pump_take_lines(pump, s); /* lines that waited for room */
    take_replies(pump, s);
    leave_when_done(pump, s);
    stream_move_reader(pump->stream, s->reader, s->cursor);
}

/* Returns the end of what is written next. On a link with messages, replies and frames have messages of their own. */
static uint32_t write_to(const struct pump *pump, const struct session *s)
{
    if (!pump->ops->messages) return s->out_len;
    return s->out_pos < s->frames_from ? s->frames_from : s->out_pos < s->frames_to ? s->frames_to : s->out_len;
}

int session_waits(const struct pump *pump, const struct session *s)
{
    return faulty_look(pump->link, session_index(pump, s)).waits;
}

int session_waits_for_files(const struct pump *pump)
{
    const struct loop_source *source = pump->links->source;
    return pump->stream->waits && faulty_is_on(pump->link) && !atomic_load(&pump->stream->over) &&
           !atomic_load(&pump->stream->ending) && source->ops->files_fill(source->self);
}

int session_pass(struct pump *pump, struct session *s, int is_last)
{
    const int ends = is_last || s->cursor >= session_power_tick(pump, s); /* a power cycle ends what came before it */
    const int64_t t_ns = ends ? INT64_MAX : (int64_t)s->cursor * pump->stream->tick_ns;
    return faulty_pass(pump->link, session_index(pump, s), t_ns);
}

/* Fills the buffer again if the link takes more now. All bytes in it have been written before. Returns as session_pass
 * does. Where nothing is left to send, the buffer stays empty, and the cursor stays where it is. */
static int fill_if_link_takes(struct pump *pump, struct session *s)
{
    const int is_over = atomic_load(&pump->stream->over);
    const uint64_t from = s->cursor;
    const int takes = session_pass(pump, s, 0);
    if (takes > 0) session_fill(pump, s);
    const int nothing = s->out_pos == s->out_len && s->cursor == from;
    return takes > 0 && is_over && nothing ? session_pass(pump, s, 1) : takes;
}

int session_write(struct pump *pump, struct session *s, int index)
{
    if (!pump->protocol->passes_native) return session_write_protocol(pump, s, index);
    for (;;) {
        const uint64_t from = s->cursor;
        ssize_t n = s->out_pos == s->out_len ? fill_if_link_takes(pump, s) : 1;
        if (n > 0 && s->out_pos == s->out_len && s->cursor != from) {
            if (lends(pump)) return 1; /* the link is full until the client has read the lent ticks */
            continue;
        }
        if (n > 0 && s->out_pos == s->out_len) {
            stream_note_written(pump->stream, s->reader, s->cursor); /* bytes that a fault holds back hold up nobody */
            return 0;
        }
        const uint32_t most = write_to(pump, s) - s->out_pos;
        if (n > 0) n = pump->ops->write(pump->link, index, s->out + s->out_pos, most);
        if (n == 0) return 1;
        if (n < 0) {
            if (n != SH_ECLOSED) pump->failed = 1; /* the reason comes with LINK_CLOSED */
            session_close(pump, s);
            return 0;
        }
        s->out_pos += (uint32_t)n;
        if ((uint32_t)n < most) return 1; /* asking again would cost another call, and bring nothing */
    }
}
