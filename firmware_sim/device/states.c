/* SPDX-License-Identifier: MIT */
/* The states of the head, and the time at which each one ends. */
#include <math.h>

#include "firmware_sim/config/profile.h"
#include "firmware_sim/device/device_state.h"

enum head_state device_visible_state(const struct device *device, uint64_t released, int *stops)
{
    const struct device_machine *machine = &device->machine;
    *stops = 0;
    for (uint32_t age = 1; age <= machine->n_changes && age <= DEVICE_MAX_CHANGES; age++) {
        const uint32_t number = machine->n_changes - age;
        const struct device_state_change *change = &machine->change[number % DEVICE_MAX_CHANGES];
        if (change->tick > released) continue;
        const int moves = change->state == HEAD_SPIN_UP || change->state == HEAD_SCANNING;
        *stops = moves && number < machine->n_stopped;
        return *stops ? HEAD_SPIN_DOWN : change->state;
    }
    return HEAD_OFF;
}

uint64_t device_rests_from(void *self)
{
    struct device *device = self;
    const struct device_machine *machine = &device->machine;
    pthread_mutex_lock(&device->lock);
    const int rests = machine->state == HEAD_IDLE || machine->state == HEAD_FAULT || machine->state == HEAD_OFF;
    const uint64_t tick =
        machine->n_changes == 0 ? 0 : machine->change[(machine->n_changes - 1) % DEVICE_MAX_CHANGES].tick + 1;
    pthread_mutex_unlock(&device->lock);
    return rests ? tick : UINT64_MAX;
}

uint64_t device_ticks_of(const struct device *device, double s)
{
    return (uint64_t)ceil(s * (double)device->tick_hz - 1e-9);
}

void device_transition(struct device *device, enum head_event event, uint64_t tick)
{
    const struct config_profile *profile = site_profile(device->site);
    int next = head_next_state(device->machine.state, event);
    if (next < 0 || (enum head_state)next == device->machine.state) return;
    enum head_state before = device->machine.state;
    if (next != HEAD_FAULT) device->cmd.why_fault = NULL;
    device->machine.state = (enum head_state)next;
    device->machine.change[device->machine.n_changes++ % DEVICE_MAX_CHANGES] =
        (struct device_state_change){tick, device->machine.state};
    device_push_event(&device->events, NATIVE_EV_STATE, (uint64_t)device->machine.state, (uint64_t)before, 0,
                      head_state_name(device->machine.state));
    device_say_time_server(device);
    uint64_t from = tick > device->next_tick ? tick : device->next_tick;
    switch (device->machine.state) {
    case HEAD_BOOT:
        device->power.boot_begins = 1;
        device->machine.due_tick = tick + device_ticks_of(device, profile->boot_s);
        break;
    case HEAD_SPIN_UP: /* it counts from the command, but never ends before the first tick that is not claimed */
        device->machine.due_tick = tick + device_ticks_of(device, profile->spin_up_s);
        if (device->machine.due_tick < device->next_tick) device->machine.due_tick = device->next_tick;
        break;
    case HEAD_SPIN_DOWN:
        device->machine.due_tick = from + device_ticks_of(device, profile->spin_down_s);
        break;
    default:
        device->machine.due_tick = UINT64_MAX;
    }
}

void device_run_timers(struct device *device, uint64_t tick)
{
    while (device->machine.due_tick <= tick) {
        device->machine.due_tick = UINT64_MAX;
        if (device->machine.state == HEAD_BOOT) {
            if (device_end_boot(device, tick)) continue;
            device_transition(device, HEAD_EV_BOOTED, tick);
            if (device->options.start) device_transition(device, HEAD_EV_START, tick);
        } else if (device->machine.state == HEAD_SPIN_UP) {
            device_transition(device, HEAD_EV_SPUN_UP, tick);
            device_begin_scan(device, tick);
        } else if (device->machine.state == HEAD_SPIN_DOWN) {
            device_transition(device, HEAD_EV_SPUN_DOWN, tick);
        }
    }
}
