/* SPDX-License-Identifier: MIT */
/* Commands of a session: lines in, replies out. */
#include <string.h>

#include "firmware_sim/base/clock.h"
#include "firmware_sim/loop/pump_inside.h"

void pump_add_reply(struct session *s, const char *text)
{
    struct session_commands *c = &s->commands;
    size_t n = strlen(text);
    if (n == 0) return;
    if (c->reply_len + n + 2 > REPLY_ROOM) {
        c->replies_dropped++;
        return;
    }
    memcpy(c->reply + c->reply_len, text, n);
    memcpy(c->reply + c->reply_len + n, "\r\n", 2);
    c->reply_len += (uint32_t)n + 2;
}

/* Reply lines that are not written yet. */
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

static void start_step(struct pump *pump, struct session *s, const struct command_result *result)
{
    struct session_commands *c = &s->commands;
    uint64_t total_ns = stream_grant(pump->stream, (uint64_t)result->step_ns);
    struct sh_err err;
    /* before time passes */
    if (result->have_pose && device_pose(pump->links->mover.device, (int64_t)total_ns, result->pose, &err) != SH_OK)
        source_report(pump->links->source, CMD_E_SETTINGS, err.text);
    c->step_tick = stream_pass(pump->stream, total_ns);
    c->stepping = 1;
    memcpy(c->step_reply, result->reply, sizeof c->step_reply);
}

static void do_line(struct pump *pump, struct session *s, enum command_line_kind kind)
{
    struct command_result result;
    const struct loop_source *source = pump->links->source;
    if (kind == COMMAND_LINE_OVERRUN)
        source->ops->overlong(source->self, s->id, &result);
    else
        source->ops->command(source->self, s->id, s->commands.lines.buf, stream_released(pump->stream), &result);
    s->commands.wrong += result.error != 0;
    const struct links_observer *observer = pump->links->observer;
    if (observer != NULL && result.error != 0)
        observer->refused(observer->ctx, s->id, s->commands.lines.buf, result.reply);
    if (result.effect == COMMAND_FAULTS) faulty_changed(pump->link, session_index(pump, s), count_replies(s) + 1);
    if (result.effect == COMMAND_STEP) {
        start_step(pump, s, &result);
    } else if (result.effect == COMMAND_MOVE) {
        s->commands.moving = 1;
        mover_ask(&pump->links->mover, &s->commands.move, pump->wake_fd);
    } else {
        pump_add_reply(s, result.reply);
    }
}

void pump_end_move(struct pump *pump, struct session *s)
{
    char reply[COMMAND_MAX_REPLY];
    if (!s->commands.moving || !mover_take(&pump->links->mover, &s->commands.move, reply)) return;
    s->commands.moving = 0;
    s->commands.wrong += reply[0] == 'E';
    pump_add_reply(s, reply);
}

static int has_reply_room(const struct session_commands *c)
{
    return c->reply_len + COMMAND_MAX_REPLY + 2 <= REPLY_ROOM || c->in_len - c->in_pos == READ_BYTES;
}

void pump_take_lines(struct pump *pump, struct session *s)
{
    struct session_commands *c = &s->commands;
    int done = 0;
    while (c->in_pos < c->in_len && !c->stepping && !c->moving && c->wrong < WRONG_AT_ONCE && has_reply_room(c)) {
        enum command_line_kind kind = command_lines_feed(&c->lines, c->in[c->in_pos++]);
        if (kind == COMMAND_LINE_NONE) continue;
        do_line(pump, s, kind);
        done = 1;
    }
    if (done && pump->stream->waits) stream_poke(pump->stream); /* in real time nothing waits for a command */
}

int pump_rest(struct pump *pump)
{
    int rests = 0;
    for (int i = 0; i < LINK_MAX_SESSIONS; i++) {
        struct session_commands *c = &pump->session[i].commands;
        rests |= pump->session[i].open && c->wrong >= WRONG_AT_ONCE;
        if (c->wrong >= WRONG_AT_ONCE) c->wrong = 0;
    }
    if (rests) clock_sleep_until_ns(clock_now_ns() + REST_NS);
    return rests;
}

void pump_read(struct pump *pump, struct session *s, int index)
{
    struct session_commands *c = &s->commands;
    memmove(c->in, c->in + c->in_pos, c->in_len - c->in_pos);
    c->in_len -= c->in_pos;
    c->in_pos = 0;
    ssize_t n =
        c->in_len < READ_BYTES ? pump->ops->read(pump->link, index, c->in + c->in_len, READ_BYTES - c->in_len) : 0;
    const struct links_observer *observer = pump->links->observer;
    if (n > 0 && observer != NULL) observer->heard(observer->ctx, s->id, c->in + c->in_len, (size_t)n);
    if (n > 0) c->in_len += (uint32_t)n;
}

void pump_read_commands(struct pump *pump, struct session *s, int index)
{
    struct session_commands *c = &s->commands;
    pump_read(pump, s, index);
    pump_take_lines(pump, s);
    /* Lines wait for a step or a move, and no more fit. The link rests, since otherwise poll() would report the
     * bytes still in the system over and over. */
    if (c->in_len - c->in_pos == READ_BYTES) c->wrong = WRONG_AT_ONCE;
    if (c->replies_dropped != 0) {
        source_report(pump->links->source, CMD_E_OVERRUN,
                      "a client sends without reading its replies; some were dropped");
        c->replies_dropped = 0;
    }
}
