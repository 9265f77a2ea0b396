/* SPDX-License-Identifier: MIT */
/* A session of a protocol that is not native: frames and time go in, and units come out (drivers/protocol/protocol.h).
 *
 * In real time the protocol keeps up with the head, whether its client reads or not, as the firmware of a device does.
 * A unit is lost as a whole where it has no room, or where another one has waited for longer than loop.queue_ms.
 * Answers are lost only where they have no room. In the paces that wait for readers no unit of the
 * stream is lost: the session takes no further tick until there is room. */
#include <stdio.h>
#include <string.h>

#include "drivers/protocol/crc32c.h"
#include "firmware_sim/loop/pump_inside.h"

enum { PIECE_BYTES = 64 }; /* input is given to the protocol in pieces so small that answers find room */

static int64_t time_of(const struct pump *pump, uint64_t tick)
{
    return (int64_t)tick * pump->stream->tick_ns;
}

/* ---- functions that the protocol may call */

static int is_stale(const struct pump *pump, const struct session *s)
{
    const struct stream *stream = pump->stream;
    return !stream->waits && s->units.n != 0 &&
           unit_queue_kind(&s->units).tick + stream->ring.queue_ticks < stream_released(stream);
}

static int host_send(void *ctx, const void *unit, size_t len)
{
    struct session *s = ctx;
    const struct unit_kind kind = {stream_released(s->pump->stream), s->cursor, s->answering};
    if (len == 0 || s->hang_up) return s->hang_up;
    if ((s->answering || !is_stale(s->pump, s)) && unit_queue_put(&s->units, unit, len, &kind) == 0) return 0;
    session_count_units(s->pump, s, 1);
    return 1;
}

static int host_command(void *ctx, const char *line, char *reply, size_t cap)
{
    struct session *s = ctx;
    struct stream *stream = s->pump->stream;
    struct command_result result;
    const struct loop_source *source = s->pump->links->source;
    source->ops->command_once(source->self, s->id, line, stream_released(stream), &result);
    if (stream->waits) stream_poke(stream);
    snprintf(reply, cap, "%s", result.reply);
    return result.error;
}

static int host_fix(void *ctx, int64_t t_ns, struct nmea_fix *fix)
{
    const struct session *s = ctx;
    return s->pump->links->source->ops->fix(s->pump->links->source->self, t_ns, fix);
}

static int64_t host_next_fix_ns(void *ctx, int64_t t_ns)
{
    const struct session *s = ctx;
    return s->pump->links->source->ops->next_fix_ns(s->pump->links->source->self, t_ns);
}

static enum protocol_pps host_pps(void *ctx, int64_t t_ns, int64_t *hour_ns)
{
    const struct session *s = ctx;
    return s->pump->links->source->ops->pps(s->pump->links->source->self, t_ns, hour_ns);
}

static int64_t host_date_ns(void *ctx, int64_t t_ns)
{
    const struct session *s = ctx;
    return s->pump->links->source->ops->date_ns(s->pump->links->source->self, t_ns);
}

static int host_store(void *ctx, const char *lines)
{
    const struct session *s = ctx;
    const struct loop_source *source = s->pump->links->source;
    return source->ops->store == NULL || source->ops->store(source->self, s->pump->protocol->name, lines);
}

static double host_window_loss_db(void *ctx)
{
    const struct session *s = ctx;
    const struct loop_source *source = s->pump->links->source;
    return source->ops->window_loss_db != NULL ? source->ops->window_loss_db(source->self) : 0.0;
}

static void host_tell_once(void *ctx, const char *text)
{
    struct pump *pump = ((struct session *)ctx)->pump;
    const uint32_t mark = crc32c(0, text, strlen(text));
    for (uint32_t i = 0; i < pump->n_told; i++)
        if (pump->told[i] == mark) return;
    if (pump->n_told == MAX_TOLD) return;
    pump->told[pump->n_told++] = mark;
    pump_say(pump, pump->n_told < MAX_TOLD
                       ? text
                       : "further messages of its protocol are not shown; the statistics count what they are about");
}

static void host_count(void *ctx, enum protocol_count what, uint64_t n)
{
    struct session *s = ctx;
    struct link_counts *counts = &s->pump->counts;
    if (n == 0) return;
    if (what == PROTOCOL_UNITS_LOST) counts->lost_units += n; /* frames lost for a slow reader: session_check_lost */
    if (what == PROTOCOL_INPUT_LOST) counts->lost_input_bytes += n;
    if (what == PROTOCOL_WRONG) counts->wrong_requests += n;
    if (what == PROTOCOL_POINTS_LOST) counts->lost_points += n;
    if (what == PROTOCOL_PULSES_UNSENT) counts->unsent_pulses += n;
    if (what != PROTOCOL_INPUT_LOST && what != PROTOCOL_WRONG) return;
    s->commands.wrong++;
    const struct links_observer *observer = s->pump->links->observer;
    if (observer != NULL) observer->refused(observer->ctx, s->id, NULL, NULL);
}

static void host_hang_up(void *ctx)
{
    struct session *s = ctx;
    s->hang_up = s->pump->ops->end != NULL;
}

/* ---- the session */

/* Shifts the times of a recording's frames to the device time of the run, as the protocol's time (pass_time) is. The
 * frames' checksums are not looked at any more. */
static void shift_times(uint8_t *frames, size_t len, int64_t shift_ns)
{
    for (size_t at = 0; at < len; at += native_frame_len(frames + at))
        native_shift_time(frames + at, shift_ns);
}

static void give_frames(const struct protocol_ops *ops, struct session *s, const uint8_t *frames, size_t len)
{
    for (size_t at = 0, n; ops->frame != NULL && at < len; at += n) {
        n = native_frame_len(frames + at);
        ops->frame(s->protocol, frames + at, n);
    }
}

/* A device has watched its fields before the client came. So where a head has fields, a new session in real time begins
 * with earlier ticks: up to three quarters of those that the ring holds, but none from before power came. Then results
 * are there at once. The session sends nothing meanwhile: its client has asked for nothing. */
static void look_back(const struct pump *pump, struct session *s)
{
    const struct loop_source *source = pump->links->source;
    const uint64_t ticks = pump->stream->ring.queue_ticks / 4 * 3; /* with room for those that come meanwhile */
    if (pump->links->identity.fields == NULL || pump->stream->waits) return;
    const int64_t power_ns = source->ops->last_power(source->self, time_of(pump, s->cursor)).t_ns;
    const uint64_t power = (uint64_t)(power_ns / pump->stream->tick_ns);
    uint64_t from = s->cursor > ticks ? s->cursor - ticks : 0;
    if (from < power) from = power;
    s->power_from = s->came_at = s->cursor; /* power that went before the client came doesn't end its session */
    if (from < s->cursor) s->cursor = from;
}

static void open_at(const struct pump *pump, const struct session *s, int64_t t_ns)
{
    if (pump->protocol->open != NULL) pump->protocol->open(s->protocol, t_ns);
}

/* Gives the protocol the descriptor, emitter and anchor from before the tick at the cursor. */
static void greet(struct pump *pump, struct session *s)
{
    static _Thread_local uint8_t frames[LATCHED_MAX_BYTES];
    uint32_t len, version, before;
    do { /* a frame latched between copy and cursor would be missed: then copy again */
        latched_copy(&pump->stream->latched, frames, &before);
        s->cursor = stream_released(pump->stream);
        len = latched_copy(&pump->stream->latched, frames, &version);
    } while (version != before);
    look_back(pump, s);
    open_at(pump, s, time_of(pump, s->cursor));
    give_frames(pump->protocol, s, frames, len);
}

_Static_assert((int)PROTOCOL_STORED == (int)SETTINGS_FILE_TEXT, "what a protocol stores fits");

static int pump_protocol_create(struct pump *pump, struct session *s, struct sh_err *err)
{
    const struct loop_source *source = pump->links->source;
    const struct device_power_up power = source->ops->last_power(source->self, time_of(pump, s->cursor));
    char stored[SETTINGS_FILE_TEXT] = "";
    struct protocol_spec spec = {
        .identity = &pump->links->identity,
        .host = {.ctx = s,
                 .send = host_send,
                 .command = host_command,
                 .fix = host_fix,
                 .count = host_count,
                 .hang_up = host_hang_up,
                 .next_fix_ns = host_next_fix_ns,
                 .pps = host_pps,
                 .date_ns = host_date_ns,
                 .store = host_store,
                 .window_loss_db = host_window_loss_db,
                 .tell_once = host_tell_once},
        .power_ns = power.t_ns,
        .power_ons = power.ons,
        .near_wrap = power.near_wrap,
        .keeps = source->ops->stored != NULL && source->ops->stored(source->self, pump->protocol->name, stored) == 0,
        .stored = stored,
        .dialect = pump->dialect,
        .shared = &pump->shared,
        .waits = pump->stream->waits,
        .port = pump->links->data_port,
        .position_port = pump->links->position_port,
    };
    snprintf(spec.address, sizeof spec.address, "%s", pump->links->data_address);
    if (source->ops->talk != NULL) spec.talk = source->ops->talk(source->self, pump->index, &spec.talk_options);
    s->pump = pump;
    s->hang_up = 0;
    if (s->units.bytes == NULL && unit_queue_create(&s->units, pump->out_cap) != SH_OK)
        return sh_fail(err, SH_ENOMEM, "no memory for a session");
    return protocol_create(pump->protocol, &spec, &s->protocol, err);
}

int pump_check_stored(struct pump *pump, struct sh_err *err)
{
    const struct loop_source *source = pump->links->source;
    char stored[SETTINGS_FILE_TEXT];
    if (pump->protocol->passes_native || source->ops->stored == NULL ||
        source->ops->stored(source->self, pump->protocol->name, stored) != 0 || stored[0] == '\0')
        return SH_OK;
    struct session *s = &pump->session[0];
    const int rc = pump_protocol_create(pump, s, err);
    if (rc == SH_OK) session_close_protocol(pump, s);
    return rc;
}

int session_open_protocol(struct pump *pump, struct session *s, struct sh_err *err)
{
    const int rc = pump_protocol_create(pump, s, err);
    if (rc == SH_OK) greet(pump, s);
    return rc;
}

int session_reopen_protocol(struct pump *pump, struct session *s)
{
    struct sh_err err; /* not used: session_power_on reports the failure */
    const int rc = pump_protocol_create(pump, s, &err);
    if (rc == SH_OK) open_at(pump, s, time_of(pump, s->cursor));
    return rc;
}

void session_close_protocol(struct pump *pump, struct session *s)
{
    protocol_destroy(pump->protocol, s->protocol);
    s->protocol = NULL;
    unit_queue_clear(&s->units);
}

/* Tells the protocol that time has come to the cursor. */
static void pass_time(struct pump *pump, struct session *s)
{
    if (pump->protocol->time != NULL) pump->protocol->time(s->protocol, time_of(pump, s->cursor));
}

/* Gives the next tick to the protocol. Returns 0 when there is none, when files have to catch up first, or when power
 * goes with that tick. */
static int take_tick(struct pump *pump, struct session *s)
{
    struct ring *ring = &pump->stream->ring;
    const struct protocol_ops *ops = pump->protocol;
    if (session_waits_for_files(pump)) return 0;
    struct ring_copy tick = {.buf = pump->tick, .cap = pump->stream->tick_bytes};
    enum ring_read got = ring_read(ring, s->reader, s->cursor, &tick);
    const uint64_t power_tick = session_power_tick(pump, s); /* after the read: it is set before its tick is released */
    if (s->cursor >= power_tick) return 0;
    if (got == RING_NONE || (got == RING_READ && tick.len > tick.cap)) return 0;
    uint64_t released = stream_released(pump->stream);
    if (got == RING_LOST && s->cursor + ring->queue_ticks < released) {
        session_catch_up(pump, s, released, power_tick); /* the number of the next tick's frames shows a loss */
        return 1;
    }
    if (s->is_off) {
        s->cursor++;
        return 1;
    }
    if (got == RING_LOST && ops->gap != NULL) ops->gap(s->protocol, 1); /* the head could not compute it */
    if (got == RING_READ) {
        uint32_t lost = session_check_lost(pump, s, &tick, released);
        if (lost != 0 && ops->gap != NULL) ops->gap(s->protocol, lost);
        if (tick.shift_ns != 0) shift_times(tick.buf, tick.len, tick.shift_ns);
        give_frames(ops, s, tick.buf, tick.len);
    }
    s->cursor++;
    pass_time(pump, s);
    return 1;
}

static int has_room(const struct session *s)
{
    return unit_queue_room(&s->units) >= s->units.cap / 2;
}

/* Returns how many bytes the protocol is given now. Where answers have no room, it gets some only once the input buffer
 * is full: a client that sends and never reads loses answers. Datagrams stay whole. */
static uint32_t piece_of(const struct pump *pump, const struct session *s)
{
    const struct session_commands *c = &s->commands;
    const uint32_t n = c->in_len - c->in_pos;
    if (pump->ops->datagrams) return n;
    if (c->wrong >= WRONG_AT_ONCE || (!has_room(s) && n != READ_BYTES)) return 0;
    const size_t most = pump->protocol->takes != NULL ? pump->protocol->takes(s->protocol) : n;
    const uint32_t piece = n < PIECE_BYTES ? n : PIECE_BYTES;
    return piece < most ? piece : (uint32_t)most;
}

/* Gives the client's bytes to the protocol. Returns whether it took any bytes. */
static int take_input(struct pump *pump, struct session *s)
{
    struct session_commands *c = &s->commands;
    const uint32_t from = c->in_pos;
    for (uint32_t n; !s->hang_up && !s->is_off && (n = piece_of(pump, s)) != 0; c->in_pos += n) {
        s->answering = 1;
        pump->protocol->input(s->protocol, c->in + c->in_pos, n);
        s->answering = 0;
    }
    if ((s->hang_up || s->is_off) && c->in_pos != c->in_len) {
        host_count(s, PROTOCOL_INPUT_LOST, c->in_len - c->in_pos);
        c->in_pos = c->in_len;
    }
    return c->in_pos != from;
}

void session_read_protocol(struct pump *pump, struct session *s, int index)
{
    struct session_commands *c = &s->commands;
    pump_read(pump, s, index);
    if (pump->ops->datagrams || s->is_off) take_input(pump, s); /* before the next one comes */
    /* Input waits, and no more fits: the link rests, for the reason in pump_read_commands. */
    if (c->in_len - c->in_pos == READ_BYTES && piece_of(pump, s) == 0) c->wrong = WRONG_AT_ONCE;
}

/* Writes until the link is full (1), or there is nothing left (0). Negative: the session is gone. */
static int flush(struct pump *pump, struct session *s, int index)
{
    const int is_over = atomic_load(&pump->stream->over) && s->cursor >= stream_released(pump->stream);
    for (;;) {
        size_t len;
        const uint8_t *unit = unit_queue_next(&s->units, &len);
        ssize_t n;
        if (unit == NULL) {
            n = session_pass(pump, s, is_over);
            if (n > 0) return 0;
        } else {
            const struct unit_kind kind = unit_queue_kind(&s->units);
            faulty_next(pump->link, index, kind.is_reply, time_of(pump, kind.made_tick));
            n = pump->ops->write(pump->link, index, unit, len);
        }
        if (n == 0) return 1;
        if (n < 0) {
            if (n != SH_ECLOSED) pump->failed = 1; /* the reason comes with LINK_CLOSED */
            return -1;
        }
        if (unit_queue_written(&s->units, (size_t)n)) pump->counts.sent_units++;
    }
}

int session_owes_protocol(const struct pump *pump, const struct session *s)
{
    const struct protocol_ops *ops = pump->protocol;
    return s->commands.in_pos != s->commands.in_len || s->units.n != 0 || ops->owes == NULL || s->is_off ||
           ops->owes(s->protocol);
}

int session_write_protocol(struct pump *pump, struct session *s, int index)
{
    int more = 1, full = 0;
    while (more && !full) {
        more = 0;
        while (has_room(s) && take_tick(pump, s))
            more = 1;
        more |= take_input(pump, s);
        more |= !has_room(s); /* ticks that had no room may have it once units are out */
        full = flush(pump, s, index);
        if (full < 0) {
            session_close(pump, s);
            return 0;
        }
    }
    while (full && !pump->stream->waits && take_tick(pump, s)) /* in real time, time goes on without the client */
        continue;
    stream_move_reader(pump->stream, s->reader, s->cursor);
    if (s->units.n == 0) {
        s->lost.lagging = 0;
        stream_note_written(pump->stream, s->reader, s->cursor);
    }
    return full;
}

uint64_t session_wake_tick(const struct pump *pump, const struct session *s)
{
    if (s->is_off) return UINT64_MAX; /* all are woken when power comes */
    if (pump->protocol->next_ns == NULL) return pump->protocol->time != NULL ? s->cursor : UINT64_MAX;
    int64_t next_ns = pump->protocol->next_ns(s->protocol);
    if (next_ns == INT64_MAX) return UINT64_MAX;
    uint64_t tick = next_ns > 0 ? (uint64_t)(next_ns / pump->stream->tick_ns) : 0;
    return tick > s->cursor ? tick : s->cursor;
}
