/* SPDX-License-Identifier: MIT */
/* Events that wait for a tick, and errors. A session gets a limited number of events a second for its errors. */
#ifndef FIRMWARE_SIM_DEVICE_EVENTS_H
#define FIRMWARE_SIM_DEVICE_EVENTS_H

#include <stdint.h>

#include "drivers/link/link.h"
#include "drivers/protocol/native.h"
#include "firmware_sim/config/limits.h"
#include "firmware_sim/device/device.h"

enum { DEVICE_MAX_PENDING = 256 };

/* Errors of a session, or of the head itself, and the events for them. */
struct device_errors {
    uint64_t until_tick; /* end of the second at hand */
    uint32_t said;       /* events in that second */
    uint32_t held;       /* errors that no event has reported yet */
    int last;            /* number of the last one of those */
};
enum { DEVICE_ERRORS_A_SECOND = 10, DEVICE_MAX_SESSIONS = (CONFIG_MAX_LINKS + 1) * LINK_MAX_SESSIONS };

/* Events that wait for a tick. */
struct device_events {
    struct native_event event[DEVICE_MAX_PENDING];
    uint32_t n, dropped;
    struct device_errors errors[DEVICE_MAX_SESSIONS + 1]; /* of session i; 0: the head */
    uint64_t held;                                        /* all errors that no event has reported */
    uint64_t tick_hz;
    const uint64_t *next_tick; /* the device's: the next one to be claimed */
};

/* Adds an event. Bytes of its text that are not printable ASCII become '~', as in error texts. A text that does not fit is
 * cut. NULL: no text. */
void device_push_event(struct device_events *events, enum native_event_code code, uint64_t a, uint64_t b, uint64_t c,
                       const char *text);
/* Puts as many events into the work as fit. */
void device_take_events(struct device_events *events, struct device_work *work);
/* Adds an event for an error of a session, or of the head (0). Each session, and the head, gets at most
 * DEVICE_ERRORS_A_SECOND such events in a second of device time. Further errors are held back. */
void device_push_error(struct device_events *events, uint32_t session, int number, const char *text);
/* Adds an event for each session of which errors were held back in a second that is over, with their number. is_over:
 * the run is over, so seconds that are not over count, too. */
void device_say_held(struct device_events *events, uint64_t tick, int is_over);

#endif
