/* SPDX-License-Identifier: MIT */
/* The null link: one session that swallows everything. For benchmarks, and the skeleton for new links. */
#include <stdlib.h>

#include "drivers/link/link_poll.h"

static int null_open(const struct link_spec *spec, void **link, struct sh_err *err)
{
    (void)spec;
    *link = link_new(sizeof(struct link_base), err, "null");
    return *link != NULL ? SH_OK : SH_ENOMEM;
}

static int null_poll(void *link, int wake_fd, uint32_t want_write, int timeout_ms, struct link_event *event, int max)
{
    struct link_base *null = link;
    struct link_events events = {event, 0, max};
    if (!null->reported_opened) null->reported_opened = link_events_push(&events, LINK_OPENED, 0, "null");
    return link_poll_sink(wake_fd, (want_write & 1u) != 0, timeout_ms, &events);
}

static ssize_t null_read(void *link, int session, void *buf, size_t len)
{
    (void)link;
    (void)buf;
    (void)len;
    return session == 0 ? 0 : SH_ECLOSED;
}

static ssize_t null_write(void *link, int session, const void *buf, size_t len)
{
    (void)link;
    (void)buf;
    return session == 0 ? (ssize_t)len : SH_ECLOSED;
}

const struct link_ops link_null = {
    .name = "null",
    .is_cheap = 1,
    .open = null_open,
    .endpoint = link_base_endpoint,
    .poll = null_poll,
    .read = null_read,
    .write = null_write,
    .close = free,
};
