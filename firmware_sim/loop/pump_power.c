/* SPDX-License-Identifier: MIT */
/* An injected power cycle, as the clients of a link see it: their sessions end abruptly, and nobody answers until
 * power is back (device_work.power).
 *
 * All frames before the tick with which power goes are written, if the client reads fast enough; in the paces that wait
 * for readers, in any case. Bytes that the client's system has not taken by then may be lost with the connection. A
 * link that no cable and no connection can end, such as a file, goes on where it was; a protocol that is not native is
 * silent until power comes, and begins anew then. With `loop.pace: step`, links come back at once, since their clients
 * let time pass. */
#include "firmware_sim/loop/pump_inside.h"

/* Whether everything released before `tick` is written, or the client does not take it. */
static int is_drained(const struct pump *pump, const struct session *s, int is_full, uint64_t tick)
{
    const int taken = s->cursor >= tick,
              written = s->out_pos == s->out_len && s->units.n == 0 && !session_waits(pump, s);
    if (pump->stream->waits) return taken && written;
    return taken || is_full || session_waits(pump, s);
}

static void plug(struct pump *pump)
{
    if (pump->is_off && pump->can_unplug) pump->ops->fault(pump->link, LINK_FAULT_PLUG, 0, 0, 0.0);
    pump->is_off = 0;
}

static void unplug(struct pump *pump, uint64_t tick)
{
    for (int i = 0; i < LINK_MAX_SESSIONS; i++) {
        struct session *s = &pump->session[i];
        if (!s->open) continue;
        if (!pump->can_unplug && pump->ops->end == NULL) {
            session_power_off(pump, s, tick);
            continue;
        }
        session_cut(pump, s);
        if (!pump->can_unplug) pump->ops->end(pump->link, i);
    }
    if (pump->can_unplug) pump->ops->fault(pump->link, LINK_FAULT_UNPLUG, 0, 0, 0.0);
    pump->is_off = 1;
    if (pump->stream->steps) plug(pump);
}

static void power_on(struct pump *pump, uint64_t tick)
{
    plug(pump);
    for (int i = 0; i < LINK_MAX_SESSIONS; i++)
        if (pump->session[i].open) session_power_on(pump, &pump->session[i], tick);
}

int pump_power(struct pump *pump, uint32_t full)
{
    uint64_t tick;
    int more = 0;
    while (!pump->is_clean && (tick = stream_power_tick(pump->stream, pump->power_seen)) != UINT64_MAX) {
        const int goes = pump->power_seen % 2 == 0;
        if (stream_released(pump->stream) <= tick) return more;
        for (int i = 0; i < LINK_MAX_SESSIONS; i++)
            if (pump->session[i].open && (goes || pump->session[i].is_off) &&
                !is_drained(pump, &pump->session[i], (int)(full >> i & 1), tick))
                return more || !pump->stream->waits;
        if (goes)
            unplug(pump, tick);
        else
            power_on(pump, tick);
        pump->power_seen++;
        more = 1; /* sessions that go on can now take this tick */
    }
    return more;
}
