/* What the links share: the list of events being filled, the wake-up, and connected stream sockets. Private.
 */
#ifndef DRIVERS_LINK_LINK_UTIL_H
#define DRIVERS_LINK_LINK_UTIL_H

#include <poll.h>

#include "drivers/link/link.h"

extern const struct link_ops link_null, link_file, link_pty, link_tcp, link_usb, link_fd;

/* Events of one poll() call. push answers 0 when there is no room; the caller then leaves its state as it is,
 * so that the event comes with the next call. */
struct link_events {
    struct link_event *event;
    int n, max;
};
int link_events_push(struct link_events *events, enum link_event_kind kind, int session, const char *peer);

/* poll(2) where an interruption by a signal is "nothing yet". Returns 0 or SH_EIO. */
int link_wait(struct pollfd *fds, nfds_t n, int timeout_ms);

/* Reports and drains wake_fd. slot is its entry after link_wait; an entry with fd -1 is ignored. */
void link_take_wake(const struct pollfd *slot, struct link_events *events);

/* poll() of links that always take bytes, never have any and never change by themselves. */
int link_poll_sink(int wake_fd, int writable, int timeout_ms, struct link_events *events);

/* Connected stream sockets, never blocking and never raising SIGPIPE. Bytes moved, 0: none now, SH_ECLOSED:
 * end of stream, reset or any other failure. */
ssize_t link_stream_read(int fd, void *buf, size_t len);
ssize_t link_stream_write(int fd, const void *buf, size_t len);
/* After poll(2): 1 when the peer is gone and nothing is left to read. */
int link_stream_ended(int fd, short revents);

/* The address of a socket as "127.0.0.1:40123" or "[::1]:40123". */
struct sockaddr;
void link_address_text(const struct sockaddr *address, unsigned len, char *buf, size_t size);

#endif
