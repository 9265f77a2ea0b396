/* SPDX-License-Identifier: MIT */
#include "firmware_sim/fault/wire_queue.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/err.h"
#include "core/grow.h"

struct wire_piece *wire_piece_new(enum wire_piece_kind kind, const void *bytes, size_t len)
{
    struct wire_piece *piece = malloc(sizeof *piece);
    uint8_t *copy = len != 0 ? malloc(len) : NULL;
    if (piece == NULL || (len != 0 && copy == NULL)) {
        free(piece);
        free(copy);
        return NULL;
    }
    *piece = (struct wire_piece){.kind = kind, .len = len, .room = len, .bytes = copy};
    if (len != 0) memcpy(copy, bytes, len);
    return piece;
}

void wire_piece_free(struct wire_piece *piece)
{
    free(piece->bytes);
    free(piece);
}

static size_t cost_of(const struct wire_piece *piece)
{
    return sizeof *piece + piece->len;
}

/* Appends the piece to the last one's write. */
static int join(struct wire_queue *queue, struct wire_piece *piece)
{
    struct wire_piece *last = queue->last;
    const int done = grow(&last->bytes, &last->room, last->len + piece->len, 1);
    if (done) {
        memcpy(last->bytes + last->len, piece->bytes, piece->len);
        last->len += piece->len;
        last->frames += piece->frames;
        last->pulses += piece->pulses;
        queue->n_bytes += piece->len;
        if (piece->not_before_ns > last->not_before_ns) last->not_before_ns = piece->not_before_ns;
    }
    wire_piece_free(piece);
    return done ? SH_OK : SH_ENOMEM;
}

int wire_queue_put(struct wire_queue *queue, struct wire_piece *piece)
{
    struct wire_piece *last = queue->last;
    if (last != NULL && last->open && last->kind == piece->kind && !piece->alone) return join(queue, piece);
    if (last != NULL) last->open = 0;
    queue->n_bytes += cost_of(piece);
    piece->next = NULL;
    *(last != NULL ? &last->next : &queue->first) = piece;
    queue->last = piece;
    return SH_OK;
}

void wire_queue_hold(struct wire_queue *queue, struct wire_piece *piece)
{
    struct wire_piece **at = &queue->held;
    while (*at != NULL)
        at = &(*at)->next;
    piece->next = NULL;
    *at = piece;
    if (piece->after == 0) queue->n_bytes += cost_of(piece);
}

void wire_queue_close(struct wire_queue *queue)
{
    if (queue->last != NULL) queue->last->open = 0;
}

/* Moves a held piece to the end. */
static int release(struct wire_queue *queue, struct wire_piece **at)
{
    struct wire_piece *piece = *at;
    *at = piece->next;
    if (piece->after == 0) queue->n_bytes -= cost_of(piece);
    return wire_queue_put(queue, piece);
}

int wire_queue_pass(struct wire_queue *queue, int of, uint64_t number, int64_t t_ns)
{
    int rc = SH_OK;
    for (;;) { /* smallest number first; of equal numbers, the piece that came first */
        struct wire_piece **next = NULL;
        for (struct wire_piece **at = &queue->held; *at != NULL; at = &(*at)->next) {
            const struct wire_piece *piece = *at;
            if (piece->after == 0 || piece->of != of || (piece->after > number && piece->t_ns >= t_ns)) continue;
            if (next == NULL || piece->after < (*next)->after) next = at;
        }
        if (next == NULL) return rc;
        if (release(queue, next) != SH_OK) rc = SH_ENOMEM;
    }
}

int wire_queue_let_go(struct wire_queue *queue, int64_t now_ns)
{
    int rc = SH_OK;
    for (struct wire_piece **at = &queue->held; *at != NULL;) {
        if ((*at)->after != 0 || (*at)->not_before_ns > now_ns) {
            at = &(*at)->next;
            continue;
        }
        (*at)->not_before_ns = 0;
        if (release(queue, at) != SH_OK) rc = SH_ENOMEM;
    }
    return rc;
}

struct wire_piece *wire_queue_due(struct wire_queue *queue, int64_t now_ns)
{
    for (;;) {
        struct wire_piece *first = queue->first;
        if (first == NULL || first->open) return NULL;
        if (first->kind == WIRE_PAUSE && !first->started) {
            const int64_t until_ns = now_ns + llround(first->for_ms * 1e6);
            if (until_ns > first->not_before_ns) first->not_before_ns = until_ns;
            first->started = 1;
        }
        if (first->not_before_ns > now_ns) return NULL;
        if (first->kind != WIRE_PAUSE) return first;
        wire_queue_pop(queue);
    }
}

int64_t wire_queue_next_ns(const struct wire_queue *queue)
{
    const struct wire_piece *first = queue->first;
    int64_t next_ns = first != NULL && !first->open ? first->not_before_ns : INT64_MAX;
    for (const struct wire_piece *held = queue->held; held != NULL; held = held->next)
        if (held->after == 0 && held->not_before_ns < next_ns) next_ns = held->not_before_ns;
    return next_ns;
}

void wire_queue_pop(struct wire_queue *queue)
{
    struct wire_piece *first = queue->first;
    queue->n_bytes -= cost_of(first);
    queue->first = first->next;
    if (queue->first == NULL) queue->last = NULL;
    wire_piece_free(first);
}

void wire_queue_count(const struct wire_queue *queue, uint64_t *frames, uint64_t *pulses)
{
    for (int i = 0; i < 2; i++)
        for (const struct wire_piece *piece = i == 0 ? queue->first : queue->held; piece != NULL; piece = piece->next) {
            *frames += piece->frames;
            *pulses += piece->pulses;
        }
}

void wire_queue_clear(struct wire_queue *queue)
{
    while (queue->first != NULL)
        wire_queue_pop(queue);
    while (queue->held != NULL) {
        struct wire_piece *held = queue->held;
        queue->held = held->next;
        wire_piece_free(held);
    }
    queue->n_bytes = 0;
}
