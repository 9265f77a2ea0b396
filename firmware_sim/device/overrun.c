/* SPDX-License-Identifier: MIT */
/* Announces the head's losses in events. Ticks and pulses that it could not compute in time are counted here
 * (lost_pulses, lost_ticks). base/line_writer.h counts lost lines of files, and loop/lost_frames.c the frames that a
 * slow reader lost. */
#include <stdio.h>
#include <string.h>

#include "firmware_sim/device/device_state.h"

/* Adds the event each time, and the error once per episode: a second without a loss ends an episode. */
void device_say_overrun(struct device *device, uint64_t tick)
{
    uint64_t ticks = atomic_load(&device->counters.lost_ticks);
    if (ticks == device->overrun.ticks_said) return;
    uint64_t pulses = atomic_load(&device->counters.lost_pulses);
    uint64_t first = device->overrun.first != UINT64_MAX ? device->overrun.first : device->scan.pulse_next;
    char text[96];
    uint64_t more = pulses - device->overrun.pulses_said;
    snprintf(text, sizeof text, "%llu pulses in %llu ticks not computed in time", (unsigned long long)more,
             (unsigned long long)(ticks - device->overrun.ticks_said));
    device_push_event(device, NATIVE_EV_OVERRUN, first, more, ticks - device->overrun.ticks_said, text);
    if (device->overrun.tick == 0 || tick - device->overrun.tick > device->tick_hz)
        command_queue_push(&device->cmd.queue, CMD_E_PULSES, text);
    device->overrun.tick = tick;
    device->overrun.ticks_said = ticks;
    device->overrun.pulses_said = pulses;
    device->overrun.first = UINT64_MAX;
}

/* Adds the event once a second, and the error once per episode. */
void device_say_lost_lines(struct device *device, uint64_t tick)
{
    struct device_lost_lines *said = &device->lost_lines;
    const uint64_t journal = atomic_load(&device->counters.lost_journal_lines);
    const uint64_t truth = atomic_load(&device->counters.lost_truth_lines);
    char text[96];
    if (journal + truth == said->said || (said->tick != 0 && tick - said->tick < device->tick_hz)) return;
    snprintf(text, sizeof text, "so far of the journal %llu, of the truth %llu", (unsigned long long)journal,
             (unsigned long long)truth);
    device_push_error(device, 0, CMD_E_LINES, text);
    if (said->tick == 0 || tick - said->tick > 2 * device->tick_hz)
        command_queue_push(&device->cmd.queue, CMD_E_LINES, text);
    said->tick = tick;
    said->said = journal + truth;
}

/* Puts the events of a lost tick before later ones. An overrun event is taken back instead: the next one
 * reports its losses and the new ones. So a long overload can't fill the room for events. */
static void take_back(struct device *device, const struct device_work *work)
{
    uint32_t n = 0;
    struct native_event event[DEVICE_MAX_EVENTS];
    for (uint32_t i = 0; i < work->n_events; i++) {
        const struct native_event *e = &work->event[i];
        if (e->code != NATIVE_EV_OVERRUN) {
            event[n++] = *e;
            continue;
        }
        device->overrun.pulses_said -= e->b;
        device->overrun.ticks_said -= e->c;
        if (e->b != 0 && e->a < device->overrun.first) device->overrun.first = e->a;
    }
    uint32_t room = DEVICE_MAX_PENDING - device->events.n;
    if (n > room) device->events.dropped += n - room;
    if (n > room) n = room;
    memmove(device->events.event + n, device->events.event, device->events.n * sizeof device->events.event[0]);
    memcpy(device->events.event, event, n * sizeof event[0]);
    device->events.n += n;
}

void device_lost(struct device *device, const struct device_work *work)
{
    pthread_mutex_lock(&device->lock);
    if (work->scanning) {
        atomic_fetch_add(&device->counters.lost_pulses, work->n_cast);
        if (work->cast0 < device->overrun.first) device->overrun.first = work->cast0;
    }
    atomic_fetch_add(&device->counters.lost_ticks, 1);
    take_back(device, work);
    if (work->describe && work->describe_flags == 0 && device->scan.on) device->scan.describe = 1;
    if (work->scanning && work->stretch != device->scan.stretch)
        device->scan.anchor_lost = 1; /* the anchor may be in this tick, or in another */
    if (work->describe && work->describe_flags != 0)
        device->scan.anchor_lost = 1; /* this may have been the repetition of a lost one */
    pthread_mutex_unlock(&device->lock);
}
