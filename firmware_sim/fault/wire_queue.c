#include "firmware_sim/fault/wire_queue.h"

#include <stdlib.h>
#include <string.h>

enum { JOINED_BYTES = 65536 }; /* pieces are joined up to this */

struct wire_piece *wire_piece_new(enum wire_piece_kind kind, const void *bytes, size_t len, size_t more)
{
    const size_t room = kind == WIRE_FRAMES && len + more < JOINED_BYTES ? JOINED_BYTES : len + more;
    struct wire_piece *piece = malloc(sizeof *piece + room);
    if (piece == NULL) return NULL;
    *piece = (struct wire_piece){.kind = kind, .len = len, .room = room};
    if (len != 0) memcpy(piece->bytes, bytes, len);
    return piece;
}

/* Whether it may be written together with the last one. */
static int joins(const struct wire_queue *queue, const struct wire_piece *piece)
{
    const struct wire_piece *last = queue->last;
    if (last == NULL || last->kind != piece->kind || piece->kind == WIRE_ACT) return 0;
    if (last->joins != 0) return piece->len <= last->room - last->len;
    return piece->kind != WIRE_UNIT && piece->joins == 0 && !last->alone && !piece->alone && piece->not_before_ns == last->not_before_ns && piece->quiet_ms <= 0.0 &&
           piece->len <= last->room - last->len;
}

void wire_queue_put(struct wire_queue *queue, struct wire_piece *piece)
{
    struct wire_piece *last = queue->last;
    queue->n_bytes += piece->len;
    piece->next = NULL;
    if (joins(queue, piece)) {
        memcpy(last->bytes + last->len, piece->bytes, piece->len);
        last->len += piece->len;
        if (last->joins != 0 && --last->joins == 0) last->alone = 1;
        free(piece);
        return;
    }
    /* What waits in front of it, it waits for as well. */
    if (last != NULL && piece->not_before_ns < last->not_before_ns) piece->not_before_ns = last->not_before_ns;
    *(last != NULL ? &last->next : &queue->first) = piece;
    queue->last = piece;
}

void wire_queue_hold(struct wire_queue *queue, struct wire_piece *piece)
{
    struct wire_piece **at = &queue->held;
    while (*at != NULL)
        at = &(*at)->next;
    piece->next = NULL;
    *at = piece;
    queue->n_bytes += piece->len;
}

/* Held pieces for which it is time go to the end. */
static void release(struct wire_queue *queue, int64_t now_ns, int all)
{
    for (struct wire_piece **at = &queue->held; *at != NULL;) {
        struct wire_piece *piece = *at;
        if (piece->behind != 0 ? !all : piece->not_before_ns > now_ns) {
            at = &piece->next;
            continue;
        }
        *at = piece->next;
        queue->n_bytes -= piece->len;
        piece->behind = 0;
        piece->not_before_ns = 0;
        wire_queue_put(queue, piece);
    }
}

void wire_queue_overtake(struct wire_queue *queue)
{
    for (struct wire_piece **at = &queue->held; *at != NULL;) {
        struct wire_piece *piece = *at;
        if (piece->behind == 0 || --piece->behind != 0) {
            at = &piece->next;
            continue;
        }
        *at = piece->next;
        queue->n_bytes -= piece->len;
        wire_queue_put(queue, piece);
    }
}

void wire_queue_let_go(struct wire_queue *queue, int64_t now_ns, int all)
{
    if (queue->held != NULL) release(queue, now_ns, all);
}

struct wire_piece *wire_queue_due(struct wire_queue *queue, int64_t now_ns, int all)
{
    struct wire_piece *first = queue->first;
    if (first == NULL || (first->joins != 0 && !all)) return NULL;
    if (first->quiet_ms > 0.0) {
        const int64_t until_ns = now_ns + (int64_t)(first->quiet_ms * 1e6);
        if (until_ns > first->not_before_ns) first->not_before_ns = until_ns;
        first->quiet_ms = 0.0;
    }
    return first->not_before_ns <= now_ns ? first : NULL;
}

int64_t wire_queue_next_ns(const struct wire_queue *queue)
{
    const struct wire_piece *first = queue->first;
    int64_t next_ns = first != NULL && first->joins == 0 ? first->not_before_ns : INT64_MAX;
    for (const struct wire_piece *held = queue->held; held != NULL; held = held->next)
        if (held->behind == 0 && held->not_before_ns < next_ns) next_ns = held->not_before_ns;
    return next_ns;
}

void wire_queue_pop(struct wire_queue *queue)
{
    struct wire_piece *first = queue->first;
    queue->n_bytes -= first->len;
    queue->first = first->next;
    if (queue->first == NULL) queue->last = NULL;
    free(first);
}

void wire_queue_clear(struct wire_queue *queue)
{
    while (queue->first != NULL)
        wire_queue_pop(queue);
    while (queue->held != NULL) {
        struct wire_piece *held = queue->held;
        queue->held = held->next;
        free(held);
    }
    queue->n_bytes = 0;
}
