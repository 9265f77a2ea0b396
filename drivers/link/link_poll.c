/* SPDX-License-Identifier: MIT */
#include "drivers/link/link_poll.h"

#include <errno.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

void *link_new(size_t size, struct sh_err *err, const char *name, ...)
{
    struct link_base *base = calloc(1, size);
    char text[sizeof base->name];
    va_list args;
    va_start(args, name);
    vsnprintf(text, sizeof text, name, args);
    va_end(args);
    if (base == NULL)
        sh_fail(err, SH_ENOMEM, "link %s: no memory", text);
    else
        memcpy(base->name, text, sizeof text);
    return base;
}

void link_base_endpoint(const void *link, char *buf, size_t len)
{
    snprintf(buf, len, "%s", ((const struct link_base *)link)->name);
}

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
