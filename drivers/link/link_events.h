/* SPDX-License-Identifier: MIT */
/* The events that a poll function of a link fills in. Private. */
#ifndef DRIVERS_LINK_LINK_EVENTS_H
#define DRIVERS_LINK_LINK_EVENTS_H

#include "drivers/link/link.h"

/* Events of one poll call. push answers 0 when there is no room. The caller then leaves its state as it is,
 * so that the event comes with the next call. */
struct link_events {
    struct link_event *event;
    int n, max;
};
int link_events_push(struct link_events *events, enum link_event_kind kind, int session, const char *peer);

#endif
