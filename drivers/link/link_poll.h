/* SPDX-License-Identifier: MIT */
/* Private helpers of links: most have the same beginning. Their poll functions add events, wait in poll(2), and report
 * the owner's wake-up. */
#ifndef DRIVERS_LINK_LINK_POLL_H
#define DRIVERS_LINK_LINK_POLL_H

#include <poll.h>

#include "drivers/link/link.h"

/* The first member of the struct of a link whose endpoint is named once, by open. */
struct link_base {
    char name[280];
    int reported_opened;
};
/* Makes a link of that size, all 0, with its name as printf writes it. NULL: there is no memory. */
__attribute__((format(printf, 3, 4))) void *link_new(size_t size, struct sh_err *err, const char *name, ...);
/* link_ops.endpoint: the name. */
void link_base_endpoint(const void *link, char *buf, size_t len);

/* Events of one poll call. push answers 0 when there is no room. The caller then leaves its state as it is,
 * so that the event comes with the next call. */
struct link_events {
    struct link_event *event;
    int n, max;
};
int link_events_push(struct link_events *events, enum link_event_kind kind, int session, const char *peer);

/* poll(2). An interruption by a signal counts as "nothing yet". Returns 0 or SH_EIO. */
int link_wait(struct pollfd *fds, nfds_t n, int timeout_ms);

/* Reports and drains wake_fd. slot is its entry after link_wait; an entry with fd -1 is ignored. */
void link_take_wake(const struct pollfd *slot, struct link_events *events);

/* Polls a link that has no descriptor to wait for. Reports LINK_WRITABLE of session 0 if `writable` is set, and the
 * owner's wake-up. Waits only where there is no event yet. */
int link_poll_sink(int wake_fd, int writable, int timeout_ms, struct link_events *events);

#endif
