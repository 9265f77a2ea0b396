/* SPDX-License-Identifier: MIT */
/* The null link: one session that swallows everything. For benchmarks, and the skeleton for new links. */
#include <stdio.h>
#include <stdlib.h>

#include "drivers/link/link_poll.h"

struct null_link {
    int reported_opened;
};

static int null_open(const struct link_spec *spec, void **link, struct sh_err *err)
{
    (void)spec;
    struct null_link *null = calloc(1, sizeof *null);
    if (null == NULL) return sh_fail(err, SH_ENOMEM, "link null: no memory");
    *link = null;
    return SH_OK;
}

static void null_endpoint(const void *link, char *buf, size_t len)
{
    (void)link;
    snprintf(buf, len, "null");
}

static int null_poll(void *link, int wake_fd, uint32_t want_write, int timeout_ms, struct link_event *event, int max)
{
    struct null_link *null = link;
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

static void null_close(void *link)
{
    free(link);
}

const struct link_ops link_null = {
    .name = "null",
    .is_cheap = 1,
    .open = null_open,
    .endpoint = null_endpoint,
    .poll = null_poll,
    .read = null_read,
    .write = null_write,
    .close = null_close,
};
