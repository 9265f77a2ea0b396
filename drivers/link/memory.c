/* SPDX-License-Identifier: MIT */
#include "drivers/link/memory.h"

#include <stdlib.h>
#include <string.h>

#include "drivers/link/link_poll.h"

struct memory_link {
    struct link_base base;
    struct link_memory *shared;
    size_t written; /* bytes of the last write, which the client may still need; 0: none */
    int reported_closed;
};

/* ---- the client's end */

size_t memory_take(struct link_memory *memory, const uint8_t **bytes)
{
    if (memory->n_taken == memory->n_pieces) return 0;
    *bytes = memory->piece[memory->n_taken].bytes;
    return memory->piece[memory->n_taken++].len;
}

size_t memory_send(struct link_memory *memory, const void *bytes, size_t len)
{
    const size_t room = sizeof memory->sent - memory->sent_len;
    if (len > room) len = room;
    memcpy(memory->sent + memory->sent_len, bytes, len);
    memory->sent_len += len;
    return len;
}

void memory_turn(struct link_memory *memory, int timeout_ms)
{
    if (memory->turn != NULL) memory->turn(memory->owner, timeout_ms);
}

void memory_leave(struct link_memory *memory)
{
    if (memory->left) return;
    memory->left = 1;
    memory->n_taken = memory->n_pieces;
    memory_turn(memory, 0);
}

/* ---- the owner's end */

static int memory_open(const struct link_spec *spec, void **link, struct sh_err *err)
{
    struct memory_link *self = link_new(sizeof *self, err, "memory");
    if (self == NULL) return SH_ENOMEM;
    self->shared = spec->memory;
    *link = self;
    return SH_OK;
}

static int memory_poll(void *link, int wake_fd, uint32_t want_write, int timeout_ms, struct link_event *event, int max)
{
    struct memory_link *self = link;
    struct link_memory *m = self->shared;
    struct link_events events = {event, 0, max};
    if (!self->base.reported_opened) self->base.reported_opened = link_events_push(&events, LINK_OPENED, 0, "memory");
    if (m->left && !self->reported_closed) self->reported_closed = link_events_push(&events, LINK_CLOSED, 0, "memory");
    if (!m->left && m->sent_len != 0) link_events_push(&events, LINK_READABLE, 0, NULL);
    return link_poll_sink(wake_fd, !m->left && (want_write & 1u) != 0 && m->n_taken == m->n_pieces, timeout_ms,
                          &events);
}

static ssize_t memory_read(void *link, int session, void *buf, size_t len)
{
    struct link_memory *m = ((struct memory_link *)link)->shared;
    if (session != 0 || m->left) return SH_ECLOSED;
    if (len > m->sent_len) len = m->sent_len;
    memcpy(buf, m->sent, len);
    memmove(m->sent, m->sent + len, m->sent_len - len);
    m->sent_len -= len;
    return (ssize_t)len;
}

static ssize_t memory_lend(void *link, int session, const void *buf, size_t len)
{
    struct link_memory *m = ((struct memory_link *)link)->shared;
    if (session != 0 || m->left) return SH_ECLOSED;
    if (m->n_taken == m->n_pieces) m->n_taken = m->n_pieces = 0;
    if (m->n_pieces == MEMORY_PIECES) return 0;
    m->piece[m->n_pieces].bytes = buf;
    m->piece[m->n_pieces++].len = len;
    return (ssize_t)len;
}

/* A write counts as taken one turn after the client took it, since until then the client needs the bytes. */
static ssize_t memory_write(void *link, int session, const void *buf, size_t len)
{
    struct memory_link *self = link;
    const struct link_memory *m = self->shared;
    if (self->written == 0 || session != 0 || m->left) {
        const ssize_t n = memory_lend(link, session, buf, len);
        if (n < 0) return n;
        self->written = (size_t)n;
        return 0;
    }
    if (m->n_taken != m->n_pieces) return 0;
    const size_t taken = self->written;
    self->written = 0;
    return (ssize_t)taken;
}

static void memory_end(void *link, int session)
{
    struct memory_link *self = link;
    if (session == 0) self->shared->over = 1;
}

static void memory_close(void *link)
{
    struct memory_link *self = link;
    self->shared->n_taken = self->shared->n_pieces;
    self->shared->turn = NULL;
    self->shared->over = 1;
    free(self);
}

const struct link_ops link_memory = {
    .name = "memory",
    .open = memory_open,
    .endpoint = link_base_endpoint,
    .poll = memory_poll,
    .read = memory_read,
    .write = memory_write,
    .lend = memory_lend,
    .end = memory_end,
    .close = memory_close,
};
