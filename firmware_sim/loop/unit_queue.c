#include "firmware_sim/loop/unit_queue.h"

#include <stdlib.h>
#include <string.h>

#include "core/err.h"

/* What stands before each unit. */
struct unit_head {
    uint64_t tick;
    uint32_t len;
    int is_reply;
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

int unit_queue_put(struct unit_queue *queue, const void *unit, size_t len, uint64_t tick, int is_reply)
{
    const struct unit_head head = {.tick = tick, .len = (uint32_t)len, .is_reply = is_reply};
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

uint64_t unit_queue_tick(const struct unit_queue *queue)
{
    return oldest(queue).tick;
}

int unit_queue_is_reply(const struct unit_queue *queue)
{
    return oldest(queue).is_reply;
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
