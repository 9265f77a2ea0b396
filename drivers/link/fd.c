/* SPDX-License-Identifier: MIT */
/* The fd link: one session over a connected stream socket that somebody else made (socketpair). The
 * descriptor's flags are left alone, since the other holder of a shared description would see them change. */
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

#include "drivers/link/link_poll.h"
#include "drivers/socket/socket.h"

struct fd_link {
    struct link_base base;
    int fd;
    int reported_closed;
    int ended;
};

static int fd_open(const struct link_spec *spec, void **link, struct sh_err *err)
{
    int type = 0;
    socklen_t len = sizeof type;
    if (getsockopt(spec->fd, SOL_SOCKET, SO_TYPE, &type, &len) != 0)
        return sh_fail(err, SH_EINPUT, "link fd:%d: not an open socket: %s", spec->fd, strerror(errno));
    if (type != SOCK_STREAM) return sh_fail(err, SH_EINPUT, "link fd:%d: not a stream socket", spec->fd);
    struct fd_link *self = link_new(sizeof *self, err, "fd:%d", spec->fd);
    if (self == NULL) return SH_ENOMEM;
    self->fd = spec->fd;
    if (spec->path[0] != '\0') snprintf(self->base.name, sizeof self->base.name, "%.60s", spec->path);
    *link = self;
    return SH_OK;
}

static int fd_poll(void *link, int wake_fd, uint32_t want_write, int timeout_ms, struct link_event *event, int max)
{
    struct fd_link *self = link;
    struct link_events events = {event, 0, max};
    if (!self->base.reported_opened)
        self->base.reported_opened = link_events_push(&events, LINK_OPENED, 0, self->base.name);
    struct pollfd fds[2] = {{.fd = wake_fd, .events = POLLIN}, {.fd = self->reported_closed ? -1 : self->fd}};
    fds[1].events = (short)(POLLIN | ((want_write & 1u) != 0 ? POLLOUT : 0));
    int rc = link_wait(fds, 2, events.n > 0 || (self->ended && !self->reported_closed) ? 0 : timeout_ms);
    if (rc != SH_OK) return rc;
    link_take_wake(&fds[0], &events);
    if (self->reported_closed) return events.n;
    const enum socket_state state = socket_state(self->fd, fds[1].revents);
    if (self->ended || state != SOCKET_OPEN) {
        self->ended = 1;
        self->reported_closed = link_events_push(&events, LINK_CLOSED, 0, self->base.name);
        return events.n;
    }
    if ((fds[1].revents & POLLIN) != 0) link_events_push(&events, LINK_READABLE, 0, NULL);
    if ((fds[1].revents & POLLOUT) != 0) link_events_push(&events, LINK_WRITABLE, 0, NULL);
    return events.n;
}

static ssize_t fd_done(struct fd_link *self, ssize_t n)
{
    if (n < 0) self->ended = 1;
    return n;
}

static ssize_t fd_read(void *link, int session, void *buf, size_t len)
{
    struct fd_link *self = link;
    if (session != 0 || self->ended) return SH_ECLOSED;
    return fd_done(self, socket_read(self->fd, buf, len));
}

static ssize_t fd_write(void *link, int session, const void *buf, size_t len)
{
    struct fd_link *self = link;
    if (session != 0 || self->ended) return SH_ECLOSED;
    return fd_done(self, socket_write_heard(self->fd, buf, len));
}

static void fd_end(void *link, int session)
{
    struct fd_link *self = link;
    if (session != 0 || self->ended) return;
    shutdown(self->fd, SHUT_WR);
    self->ended = 1;
}

static void fd_close(void *link)
{
    struct fd_link *self = link;
    close(self->fd);
    free(self);
}

const struct link_ops link_fd = {
    .name = "fd",
    .open = fd_open,
    .endpoint = link_base_endpoint,
    .poll = fd_poll,
    .read = fd_read,
    .write = fd_write,
    .end = fd_end,
    .close = fd_close,
};
