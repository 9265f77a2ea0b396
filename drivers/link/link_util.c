#include "drivers/link/link_util.h"

#include <errno.h>
#include <netdb.h>
#include <stdio.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

int link_events_push(struct link_events *events, enum link_event_kind kind, int session, const char *peer)
{
    if (events->n >= events->max) return 0;
    struct link_event *event = &events->event[events->n++];
    event->kind = kind;
    event->session = session;
    snprintf(event->peer, sizeof event->peer, "%s", peer != NULL ? peer : "");
    return 1;
}

int link_wait(struct pollfd *fds, nfds_t n, int timeout_ms)
{
    if (poll(fds, n, timeout_ms) >= 0) return SH_OK;
    if (errno != EINTR) return SH_EIO;
    for (nfds_t i = 0; i < n; i++)
        fds[i].revents = 0;
    return SH_OK;
}

void link_take_wake(const struct pollfd *slot, struct link_events *events)
{
    if (slot->fd < 0 || (slot->revents & POLLIN) == 0) return;
    if (!link_events_push(events, LINK_WOKEN, 0, NULL)) return;
    uint64_t count;
    ssize_t drained = read(slot->fd, &count, sizeof count);
    (void)drained; /* poll said there is a count, and nobody else reads it */
}

int link_poll_sink(int wake_fd, int writable, int timeout_ms, struct link_events *events)
{
    if (writable) link_events_push(events, LINK_WRITABLE, 0, NULL);
    struct pollfd slot = {.fd = wake_fd, .events = POLLIN};
    int rc = link_wait(&slot, 1, events->n > 0 ? 0 : timeout_ms);
    if (rc != SH_OK) return rc;
    link_take_wake(&slot, events);
    return events->n;
}

ssize_t link_stream_read(int fd, void *buf, size_t len)
{
    if (len == 0) return 0;
    ssize_t n = recv(fd, buf, len, MSG_DONTWAIT);
    if (n > 0) return n;
    if (n < 0 && (errno == EAGAIN || errno == EWOULDBLOCK || errno == EINTR)) return 0;
    return SH_ECLOSED;
}

ssize_t link_stream_write(int fd, const void *buf, size_t len)
{
    ssize_t n = send(fd, buf, len, MSG_DONTWAIT | MSG_NOSIGNAL);
    if (n >= 0) return n;
    /* ENOBUFS and ENOMEM: the system is short of memory for now, the connection is sound. */
    if (errno == EAGAIN || errno == EWOULDBLOCK || errno == EINTR || errno == ENOBUFS || errno == ENOMEM) return 0;
    return SH_ECLOSED;
}

int link_stream_ended(int fd, short revents)
{
    if ((revents & (POLLIN | POLLHUP | POLLERR | POLLNVAL)) == 0) return 0;
    char byte;
    ssize_t n = recv(fd, &byte, 1, MSG_DONTWAIT | MSG_PEEK);
    return n == 0 || (n < 0 && errno != EAGAIN && errno != EWOULDBLOCK && errno != EINTR);
}

void link_address_text(const struct sockaddr *address, unsigned len, char *buf, size_t size)
{
    char host[64], port[8];
    int rc =
        getnameinfo(address, (socklen_t)len, host, sizeof host, port, sizeof port, NI_NUMERICHOST | NI_NUMERICSERV);
    if (rc != 0)
        snprintf(buf, size, "unknown address");
    else if (strchr(host, ':') != NULL)
        snprintf(buf, size, "[%s]:%s", host, port);
    else
        snprintf(buf, size, "%s:%s", host, port);
}
