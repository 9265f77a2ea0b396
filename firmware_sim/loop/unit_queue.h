/* SPDX-License-Identifier: MIT */
/* Units of a protocol on their way to a client: first in, first out, each whole or not at all.
 *
 * In: units with the tick at which they were made. Out: the oldest one, in pieces as the link takes them.
 * Thread: one. Allocates in create alone. */
#ifndef FIRMWARE_SIM_LOOP_UNIT_QUEUE_H
#define FIRMWARE_SIM_LOOP_UNIT_QUEUE_H

#include <stddef.h>
#include <stdint.h>

struct unit_queue {
    uint8_t *bytes;
    uint32_t cap;
    uint32_t begin, end; /* units lie in between, each after its head */
    uint32_t n;          /* units */
    uint32_t out;        /* bytes of the oldest one that are written */
};

/* Returns 0, or SH_ENOMEM. */
int unit_queue_create(struct unit_queue *queue, uint32_t cap);
void unit_queue_free(struct unit_queue *queue);
void unit_queue_clear(struct unit_queue *queue);

/* Bytes that further units may have, less a few for each. */
uint32_t unit_queue_room(const struct unit_queue *queue);
struct unit_kind {
    uint64_t tick;      /* when it was made */
    uint64_t made_tick; /* of the stream, up to which it was made: the same at any pace */
    int is_reply;       /* it answers the client */
};

/* Returns 0, or 1: it has no room. */
int unit_queue_put(struct unit_queue *queue, const void *unit, size_t len, const struct unit_kind *kind);
/* Of the oldest unit. There is one. */
struct unit_kind unit_queue_kind(const struct unit_queue *queue);
/* What is left of the oldest unit; NULL: there is none. */
const uint8_t *unit_queue_next(const struct unit_queue *queue, size_t *len);
/* So many bytes of it were written. Returns 1 when they were its last. */
int unit_queue_written(struct unit_queue *queue, size_t n);

#endif
