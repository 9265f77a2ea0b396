/* SPDX-License-Identifier: MIT */
/* Events on their way into ticks. */
#include <stdio.h>
#include <string.h>

#include "firmware_sim/device/device_state.h"

void device_push_event(struct device *device, enum native_event_code code, uint64_t a, uint64_t b, uint64_t c,
                       const char *text)
{
    if (device->events.n == DEVICE_MAX_PENDING) {
        device->events.dropped++;
        return;
    }
    struct native_event *event = &device->events.event[device->events.n++];
    *event = (struct native_event){.code = (uint32_t)code, .a = a, .b = b, .c = c};
    snprintf(event->text, sizeof event->text, "%s", text != NULL ? text : "");
}

void device_push_error(struct device *device, uint32_t session, int number, const char *text)
{
    struct device_errors *errors = &device->errors[session <= DEVICE_MAX_SESSIONS ? session : 0];
    uint64_t tick = device->next_tick;
    if (errors->held == 0 && tick >= errors->until_tick) {
        errors->until_tick = tick + device->tick_hz;
        errors->said = 0;
    }
    if (errors->said < DEVICE_ERRORS_A_SECOND && device->events.n < DEVICE_MAX_PENDING) {
        errors->said++;
        device_push_event(device, NATIVE_EV_ERROR, (uint64_t)(int64_t)number, session, 0, text);
    } else {
        errors->held++;
        errors->last = number;
        device->held++;
    }
}

/* At the end of the run the events do not wait until the second is over. */
void device_say_held(struct device *device, uint64_t tick)
{
    for (uint32_t i = 0; i <= DEVICE_MAX_SESSIONS && device->held != 0; i++) {
        struct device_errors *errors = &device->errors[i];
        if (errors->held == 0 || (tick < errors->until_tick && !device->over)) continue;
        if (device->events.n == DEVICE_MAX_PENDING) return;
        char text[96];
        snprintf(text, sizeof text, "%u more errors of session %u", errors->held, i);
        device_push_event(device, NATIVE_EV_ERROR, (uint64_t)(int64_t)errors->last, i, errors->held, text);
        device->held -= errors->held;
        *errors = (struct device_errors){.until_tick = tick + device->tick_hz};
    }
}

void device_take_events(struct device *device, struct device_work *work)
{
    uint32_t n = DEVICE_MAX_EVENTS - work->n_events;
    if (n > device->events.n) n = device->events.n;
    memcpy(work->event + work->n_events, device->events.event, n * sizeof device->events.event[0]);
    memmove(device->events.event, device->events.event + n, (device->events.n - n) * sizeof device->events.event[0]);
    work->n_events += n;
    device->events.n -= n;
    if (device->events.dropped != 0 && device->events.n < DEVICE_MAX_PENDING) {
        char text[96];
        snprintf(text, sizeof text, "%u events had no room", device->events.dropped);
        device->events.dropped = 0;
        device_push_event(device, NATIVE_EV_ERROR, (uint64_t)(int64_t)CMD_E_QUEUE, 0, 0, text);
    }
}
