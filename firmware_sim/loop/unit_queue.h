/* SPDX-License-Identifier: MIT */
/* A queue of a protocol's units on their way to a client: first in, first out; a unit goes in whole or not at all.
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
    uint32_t begin, end; /* units lie between these, each after its header */
    uint32_t n;          /* units */
    uint32_t out;        /* bytes of the oldest one that are written */
};

/* Returns 0, or SH_ENOMEM. */
int unit_queue_create(struct unit_queue *queue, uint32_t cap);
void unit_queue_free(struct unit_queue *queue);
void unit_queue_clear(struct unit_queue *queue);

/* Returns the bytes that are left for further units. Each unit takes a few bytes more than its length. */
uint32_t unit_queue_room(const struct unit_queue *queue);
struct unit_kind {
    uint64_t tick;      /* the last released tick when it was made: its age counts from there */
    uint64_t made_tick; /* the tick that the session had reached in the stream: the same at any pace */
    int is_reply;       /* it answers the client */
};

/* Returns 0, or 1: it has no room. */
int unit_queue_put(struct unit_queue *queue, const void *unit, size_t len, const struct unit_kind *kind);
/* Returns the kind of the oldest unit. The queue must not be empty. */
struct unit_kind unit_queue_kind(const struct unit_queue *queue);
/* Returns the rest of the oldest unit; NULL: the queue is empty. */
const uint8_t *unit_queue_next(const struct unit_queue *queue, size_t *len);
/* n bytes of the oldest unit were written. Returns 1 when they were its last. */
int unit_queue_written(struct unit_queue *queue, size_t n);

#endif
