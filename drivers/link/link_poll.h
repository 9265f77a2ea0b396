/* SPDX-License-Identifier: MIT */
/* Shared by the poll functions of links that wait in poll(2): the wait, the wake-up. Private. */
#ifndef DRIVERS_LINK_LINK_POLL_H
#define DRIVERS_LINK_LINK_POLL_H

#include <poll.h>

#include "drivers/link/link_events.h"

/* poll(2). An interruption by a signal counts as "nothing yet". Returns 0 or SH_EIO. */
int link_wait(struct pollfd *fds, nfds_t n, int timeout_ms);

/* Reports and drains wake_fd. slot is its entry after link_wait; an entry with fd -1 is ignored. */
void link_take_wake(const struct pollfd *slot, struct link_events *events);

/* The whole poll of links that always take bytes, never have any and never change by themselves. */
int link_poll_sink(int wake_fd, int writable, int timeout_ms, struct link_events *events);

#endif
