/* SPDX-License-Identifier: MIT */
/* Events on their way into ticks. */
#include <stdio.h>
#include <string.h>

#include "firmware_sim/command/command.h"
#include "firmware_sim/device/events.h"

void device_push_event(struct device_events *events, enum native_event_code code, uint64_t a, uint64_t b, uint64_t c,
                       const char *text)
{
    if (events->n == DEVICE_MAX_PENDING) {
        events->dropped++;
        return;
    }
    struct native_event *event = &events->event[events->n++];
    *event = (struct native_event){.code = (uint32_t)code, .a = a, .b = b, .c = c};
    snprintf(event->text, sizeof event->text, "%s", text != NULL ? text : "");
    for (char *p = event->text; *p != '\0'; p++)
        if (*p < 0x20 || *p > 0x7e) *p = '~'; /* names of stations, for one, are UTF-8 */
}

void device_push_error(struct device_events *events, uint32_t session, int number, const char *text)
{
    struct device_errors *errors = &events->errors[session <= DEVICE_MAX_SESSIONS ? session : 0];
    uint64_t tick = *events->next_tick;
    if (errors->held == 0 && tick >= errors->until_tick) {
        errors->until_tick = tick + events->tick_hz;
        errors->said = 0;
    }
    if (errors->said < DEVICE_ERRORS_A_SECOND && events->n < DEVICE_MAX_PENDING) {
        errors->said++;
        device_push_event(events, NATIVE_EV_ERROR, (uint64_t)(int64_t)number, session, 0, text);
    } else {
        errors->held++;
        errors->last = number;
        events->held++;
    }
}

/* Errors that were held back are reported once their second of device time is over, or at the end of the run. */
void device_say_held(struct device_events *events, uint64_t tick, int is_over)
{
    for (uint32_t i = 0; i <= DEVICE_MAX_SESSIONS && events->held != 0; i++) {
        struct device_errors *errors = &events->errors[i];
        if (errors->held == 0 || (tick < errors->until_tick && !is_over)) continue;
        if (events->n == DEVICE_MAX_PENDING) return;
        char text[96];
        snprintf(text, sizeof text, "%u more errors of session %u", errors->held, i);
        device_push_event(events, NATIVE_EV_ERROR, (uint64_t)(int64_t)errors->last, i, errors->held, text);
        events->held -= errors->held;
        *errors = (struct device_errors){.until_tick = tick + events->tick_hz};
    }
}

void device_take_events(struct device_events *events, struct device_work *work)
{
    uint32_t n = DEVICE_MAX_EVENTS - work->n_events;
    if (n > events->n) n = events->n;
    memcpy(work->event + work->n_events, events->event, n * sizeof events->event[0]);
    memmove(events->event, events->event + n, (events->n - n) * sizeof events->event[0]);
    work->n_events += n;
    events->n -= n;
    if (events->dropped != 0 && events->n < DEVICE_MAX_PENDING) {
        char text[96];
        snprintf(text, sizeof text, "%u events had no room", events->dropped);
        events->dropped = 0;
        device_push_event(events, NATIVE_EV_ERROR, (uint64_t)(int64_t)CMD_E_QUEUE, 0, 0, text);
    }
}
