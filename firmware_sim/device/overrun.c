/* SPDX-License-Identifier: MIT */
/* Announces the head's losses in events. Ticks and pulses that it could not compute in time are counted here
 * (lost_pulses, lost_ticks). base/line_writer.h counts lost lines of files, and loop/lost_frames.c the frames that a
 * slow reader lost. */
#include <stdio.h>
#include <string.h>

#include "firmware_sim/device/overrun.h"

/* Adds the event each time, and the error once per episode: a second without a loss ends an episode. */
void device_say_overrun(struct device_overrun *overrun, uint64_t pulse_next, uint64_t tick)
{
    uint64_t ticks = atomic_load(&overrun->counters->lost_ticks);
    if (ticks == overrun->ticks_said) return;
    uint64_t pulses = atomic_load(&overrun->counters->lost_pulses);
    uint64_t first = overrun->first != UINT64_MAX ? overrun->first : pulse_next;
    char text[96];
    uint64_t more = pulses - overrun->pulses_said;
    snprintf(text, sizeof text, "%llu pulses in %llu ticks not computed in time", (unsigned long long)more,
             (unsigned long long)(ticks - overrun->ticks_said));
    device_push_event(overrun->events, NATIVE_EV_OVERRUN, first, more, ticks - overrun->ticks_said, text);
    if (overrun->tick == 0 || tick - overrun->tick > overrun->tick_hz)
        command_queue_push(overrun->queue, CMD_E_PULSES, text);
    overrun->tick = tick;
    overrun->ticks_said = ticks;
    overrun->pulses_said = pulses;
    overrun->first = UINT64_MAX;
}

/* Adds the event once a second, and the error once per episode: here two seconds without a loss end an episode. */
void device_say_lost_lines(struct device_overrun *overrun, uint64_t tick)
{
    const uint64_t journal = atomic_load(&overrun->counters->lost_journal_lines);
    const uint64_t truth = atomic_load(&overrun->counters->lost_truth_lines);
    char text[96];
    if (journal + truth == overrun->lines_said ||
        (overrun->lines_tick != 0 && tick - overrun->lines_tick < overrun->tick_hz))
        return;
    snprintf(text, sizeof text, "so far of the journal %llu, of the truth %llu", (unsigned long long)journal,
             (unsigned long long)truth);
    device_push_error(overrun->events, 0, CMD_E_LINES, text);
    if (overrun->lines_tick == 0 || tick - overrun->lines_tick > 2 * overrun->tick_hz)
        command_queue_push(overrun->queue, CMD_E_LINES, text);
    overrun->lines_tick = tick;
    overrun->lines_said = journal + truth;
}

/* Puts the events of a lost tick before later ones; is_forgotten: drops them. An overrun event is taken back instead:
 * the next one reports its losses and the new ones. So a long overload can't fill the room for events. */
static void take_back(struct device_overrun *overrun, const struct device_work *work, int is_forgotten)
{
    struct device_events *events = overrun->events;
    uint32_t n = 0;
    struct native_event event[DEVICE_MAX_EVENTS];
    for (uint32_t i = 0; i < work->n_events; i++) {
        const struct native_event *e = &work->event[i];
        if (e->code != NATIVE_EV_OVERRUN) {
            if (!is_forgotten) event[n++] = *e;
            continue;
        }
        overrun->pulses_said -= e->b;
        overrun->ticks_said -= e->c;
        if (e->b != 0 && e->a < overrun->first) overrun->first = e->a;
    }
    uint32_t room = DEVICE_MAX_PENDING - events->n;
    if (n > room) events->dropped += n - room;
    if (n > room) n = room;
    memmove(events->event + n, events->event, events->n * sizeof events->event[0]);
    memcpy(events->event, event, n * sizeof event[0]);
    events->n += n;
}

void device_count_lost(struct device_overrun *overrun, const struct device_work *work, uint64_t off_tick)
{
    if (work->scanning) {
        atomic_fetch_add(&overrun->counters->lost_pulses, work->n_cast);
        if (work->cast0 < overrun->first) overrun->first = work->cast0;
    }
    atomic_fetch_add(&overrun->counters->lost_ticks, 1);
    take_back(overrun, work, work->tick < off_tick);
}
