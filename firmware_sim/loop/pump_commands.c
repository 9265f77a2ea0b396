/* Command lines of a session in, its replies towards the buffer. */
#include <string.h>

#include "firmware_sim/loop/pump_inside.h"

void pump_add_reply(struct session *s, const char *text)
{
    size_t n = strlen(text);
    if (n == 0) return;
    if (s->reply_len + n + 2 > REPLY_ROOM) {
        s->replies_dropped++;
        return;
    }
    memcpy(s->reply + s->reply_len, text, n);
    memcpy(s->reply + s->reply_len + n, "\r\n", 2);
    s->reply_len += (uint32_t)n + 2;
}

static void start_step(struct pump *pump, struct session *s, const struct command_result *result)
{
    struct loop *loop = pump->loop;
    uint64_t total = atomic_fetch_add(&loop->granted_ns, (uint64_t)result->step_ns) + (uint64_t)result->step_ns;
    s->step_tick = total / (uint64_t)loop->tick_ns;
    if (result->have_pose)
        device_pose_numbers(loop->device, (int64_t)total, result->pose); /* before its time is granted */
    atomic_store(&loop->granted, s->step_tick);
    s->stepping = 1;
    memcpy(s->step_reply, result->reply, sizeof s->step_reply);
}

static void do_line(struct pump *pump, struct session *s, enum command_line_kind kind)
{
    struct command_result result;
    uint64_t released = atomic_load(&pump->loop->ring.released);
    if (kind == COMMAND_LINE_OVERRUN)
        device_overlong(pump->loop->device, s->id, &result);
    else
        device_command(pump->loop->device, s->id, s->lines.buf, released, &result);
    if (result.effect == COMMAND_STEP)
        start_step(pump, s, &result);
    else
        pump_add_reply(s, result.reply);
    loop_poke(pump->loop);
}

static int has_reply_room(const struct session *s)
{
    return s->reply_len + COMMAND_MAX_REPLY + 2 <= REPLY_ROOM || s->in_len - s->in_pos == READ_BYTES;
}

void pump_take_lines(struct pump *pump, struct session *s)
{
    while (s->in_pos < s->in_len && !s->stepping && has_reply_room(s)) {
        enum command_line_kind kind = command_lines_feed(&s->lines, s->in[s->in_pos++]);
        if (kind != COMMAND_LINE_NONE) do_line(pump, s, kind);
    }
}

void pump_read_commands(struct pump *pump, struct session *s, int index)
{
    memmove(s->in, s->in + s->in_pos, s->in_len - s->in_pos);
    s->in_len -= s->in_pos;
    s->in_pos = 0;
    ssize_t n =
        s->in_len < READ_BYTES ? pump->ops->read(pump->link, index, s->in + s->in_len, READ_BYTES - s->in_len) : 0;
    if (n > 0) s->in_len += (uint32_t)n;
    pump_take_lines(pump, s);
    if (s->replies_dropped != 0) {
        device_report(pump->loop->device, CMD_E_OVERRUN,
                      "a client sends without reading its replies; some were dropped");
        s->replies_dropped = 0;
    }
}
