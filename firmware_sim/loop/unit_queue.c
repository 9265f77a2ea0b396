/* SPDX-License-Identifier: MIT */
#include "firmware_sim/loop/unit_queue.h"

#include <stdlib.h>
#include <string.h>

#include "core/err.h"

/* The header before each unit in the queue. */
struct unit_head {
    struct unit_kind kind;
    uint32_t len;
};

int unit_queue_create(struct unit_queue *queue, uint32_t cap)
{
    *queue = (struct unit_queue){.bytes = malloc(cap), .cap = cap};
    return queue->bytes != NULL ? SH_OK : SH_ENOMEM;
}

void unit_queue_free(struct unit_queue *queue)
{
    free(queue->bytes);
    *queue = (struct unit_queue){0};
}

void unit_queue_clear(struct unit_queue *queue)
{
    queue->begin = queue->end = queue->n = queue->out = 0;
}

uint32_t unit_queue_room(const struct unit_queue *queue)
{
    return queue->cap - (queue->end - queue->begin);
}

int unit_queue_put(struct unit_queue *queue, const void *unit, size_t len, const struct unit_kind *kind)
{
    const struct unit_head head = {.kind = *kind, .len = (uint32_t)len};
    if (len + sizeof head > unit_queue_room(queue)) return 1;
    if (len + sizeof head > queue->cap - queue->end) {
        memmove(queue->bytes, queue->bytes + queue->begin, queue->end - queue->begin);
        queue->end -= queue->begin;
        queue->begin = 0;
    }
    memcpy(queue->bytes + queue->end, &head, sizeof head);
    memcpy(queue->bytes + queue->end + sizeof head, unit, len);
    queue->end += (uint32_t)(sizeof head + len);
    queue->n++;
    return 0;
}

static struct unit_head oldest(const struct unit_queue *queue)
{
    struct unit_head head;
    memcpy(&head, queue->bytes + queue->begin, sizeof head);
    return head;
}

struct unit_kind unit_queue_kind(const struct unit_queue *queue)
{
    return oldest(queue).kind;
}

const uint8_t *unit_queue_next(const struct unit_queue *queue, size_t *len)
{
    if (queue->n == 0) return NULL;
    *len = oldest(queue).len - queue->out;
    return queue->bytes + queue->begin + sizeof(struct unit_head) + queue->out;
}

int unit_queue_written(struct unit_queue *queue, size_t n)
{
    const uint32_t len = oldest(queue).len;
    queue->out += (uint32_t)n;
    if (queue->out < len) return 0;
    queue->begin += (uint32_t)sizeof(struct unit_head) + len;
    queue->out = 0;
    if (--queue->n == 0) unit_queue_clear(queue);
    return 1;
}
