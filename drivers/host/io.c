/* SPDX-License-Identifier: MIT */
/* Waiting and reading, with deadlines on the monotonic clock; and the sources that are descriptors. */
#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

#include "core/monotonic.h"
#include "drivers/host/exchange.h"

int64_t host_deadline_ns(int timeout_ms)
{
    return timeout_ms < 0 ? INT64_MAX : monotonic_ns() + (int64_t)timeout_ms * 1000000;
}

static ssize_t fd_read(struct host_source *source, void *to, size_t len)
{
    return read(source->fd, to, len);
}

static ssize_t fd_write(struct host_source *source, const void *data, size_t len)
{
    return source->is_socket ? send(source->fd, data, len, MSG_NOSIGNAL) : write(source->fd, data, len);
}

int host_fd_wait(struct host_source *source, short events, int64_t deadline_ns, short *revents)
{
    struct timespec left = {0}, *wait = NULL;
    if (deadline_ns != INT64_MAX) {
        int64_t left_ns = deadline_ns - host_deadline_ns(0);
        if (left_ns < 0) left_ns = 0;
        left.tv_sec = left_ns / 1000000000;
        left.tv_nsec = left_ns % 1000000000;
        wait = &left;
    }
    struct pollfd p = {.fd = source->fd, .events = events};
    int n = ppoll(&p, 1, wait, NULL);
    *revents = p.revents;
    return n;
}

/* Other descriptors may share the open file description of "fd:N", so it gets back its flag. */
static void fd_close(struct host_source *source)
{
    const int flags = source->was_blocking ? fcntl(source->fd, F_GETFL) : -1;
    if (flags >= 0) fcntl(source->fd, F_SETFL, flags & ~O_NONBLOCK);
    close(source->fd);
}

const struct host_source_ops host_fd_ops = {
    .read = fd_read, .write = fd_write, .wait = host_fd_wait, .close = fd_close};

int host_wait(struct scanhead *sh, short events, int64_t deadline_ns, short *revents)
{
    for (;;) {
        int n = sh->source.ops->wait(&sh->source, events, deadline_ns, revents);
        if (n > 0) return 0;
        if (n == 0) return sh_fail(&sh->err, SH_ETIMEOUT, "%s: no data came within the time limit", sh->source.name);
        if (errno != EINTR) return sh_fail(&sh->err, SH_EIO, "%s: %s", sh->source.name, strerror(errno));
        /* A wait without a time limit may last for ever. So a signal ends it, and the program can act on that. */
        if (sh->has_no_limit)
            return sh_fail(&sh->err, SH_ETIMEOUT, "%s: a signal interrupted the wait", sh->source.name);
    }
}

int host_is_hang_up(const struct scanhead *sh, int error)
{
    if (sh->source.usb != NULL) return error == ENODEV || error == ECONNRESET;
    if (sh->source.is_file) return 0;
    switch (error) {
    case EIO: /* a pty whose master is closed */
    case ENODEV:
    case ENXIO:
    case EPIPE:
    case ECONNRESET:
    case ETIMEDOUT: /* from here on: TCP has given up, and reports its last failure */
    case EHOSTUNREACH:
    case ENETUNREACH:
    case ENETDOWN:
        return 1;
    default:
        return 0;
    }
}

void host_note_loss(struct scanhead *sh, int error)
{
    sh->reset = sh->source.usb != NULL && error == ECONNRESET;
    sh->lost = sh->source.usb != NULL && !sh->reset;
}

/* Takes bytes from the source into the parser. Returns as read() does. */
static ssize_t io_take(struct scanhead *sh)
{
    struct host_source *source = &sh->source;
    const uint8_t *items;
    size_t room;
    if (source->ops->lend != NULL) {
        const ssize_t n = source->ops->lend(source, &items);
        if (n > 0) native_parser_lend(&sh->parser, items, (size_t)n);
        return n;
    }
    uint8_t *to = native_parser_room(&sh->parser, &room);
    const ssize_t n = source->ops->read(source, to, room);
    if (n > 0) native_parser_added(&sh->parser, (size_t)n);
    return n;
}

int host_fill(struct scanhead *sh, int64_t deadline_ns)
{
    for (;;) {
        const ssize_t n = io_take(sh);
        if (n > 0) return 0;
        if (n == 0 || host_is_hang_up(sh, errno)) {
            native_parser_finish(&sh->parser);
            sh->ended = 1;
            host_note_loss(sh, n < 0 ? errno : 0);
            return 0;
        }
        if (errno == EINTR) continue;
        if (errno != EAGAIN) return sh_fail(&sh->err, SH_EIO, "%s: cannot read: %s", sh->source.name, strerror(errno));
        short revents;
        int rc = host_wait(sh, POLLIN, deadline_ns, &revents);
        if (rc != 0) return rc;
    }
}
