/* SPDX-License-Identifier: MIT */
#include "firmware_sim/loop/ring.h"

#include <sched.h>
#include <stdlib.h>
#include <string.h>

enum phase { COMPUTING = 1, READY = 2, LOST = 3 };

static uint64_t state_of(uint64_t tick, enum phase phase)
{
    return tick << 2 | (uint64_t)phase;
}

static struct ring_slot *slot_of(struct ring *ring, uint64_t tick)
{
    return &ring->slot[tick % ring->n_slots];
}

void ring_hits_add(struct ring_hits *sum, const struct ring_hits *more)
{
    sum->echoes += more->echoes;
    sum->empty += more->empty;
    sum->crowded += more->crowded;
    sum->faint += more->faint;
    sum->unfit += more->unfit;
    sum->lost_samples += more->lost_samples;
}

static size_t round_up(size_t bytes)
{
    /* Ticks differ a little in size. With rounded sizes malloc can give a tick memory that another tick has freed. */
    enum { STEP = 1024 };
    return (bytes + STEP - 1) / STEP * STEP;
}

int ring_create(struct ring *ring, const struct ring_size *size, struct sh_err *err)
{
    memset(ring, 0, sizeof *ring);
    ring->queue_ticks = size->queue_ticks;
    ring->n_slots = size->ahead_ticks + size->queue_ticks + size->spare_ticks + 8;
    ring->slot = calloc(ring->n_slots, sizeof *ring->slot);
    int rc = ring->slot != NULL ? SH_OK : SH_ENOMEM;
    for (uint64_t i = 0; i < ring->n_slots && rc == SH_OK; i++) {
        struct ring_slot *slot = &ring->slot[i];
        slot->store_room = round_up(size->usual_bytes);
        if ((slot->store = malloc(slot->store_room)) == NULL) rc = SH_ENOMEM;
    }
    if (rc == SH_OK) return SH_OK;
    sh_fail(err, rc, "loop: no memory for %llu slots of %u bytes; lower loop.queue_ms",
            (unsigned long long)ring->n_slots, size->usual_bytes);
    ring_free(ring);
    return rc;
}

void ring_free(struct ring *ring)
{
    for (uint64_t i = 0; i < ring->n_slots && ring->slot != NULL; i++) {
        free(ring->slot[i].store);
        free(ring->slot[i].longer);
    }
    free(ring->slot);
    ring->slot = NULL;
}

static int is_being_read(struct ring *ring, uint64_t tick)
{
    for (int i = 0; i < RING_MAX_READERS; i++)
        if (atomic_load(&ring->hazard[i]) == tick + 1) return 1;
    return 0;
}

struct ring_slot *ring_claim(struct ring *ring, uint64_t tick)
{
    struct ring_slot *slot = slot_of(ring, tick);
    /* No claim is further ahead of `released` than ahead_ticks. So the slot's old tick is too old to be read by now,
     * and a reader that begins after this look finds that out (ring_look). */
    while (atomic_load(&slot->busy) || (tick >= ring->n_slots && is_being_read(ring, tick - ring->n_slots)))
        sched_yield();
    uint64_t seen = atomic_load(&slot->state);
    /* When casters are late by more than the whole ring, the slot has the state of a later tick. */
    if (tick < atomic_load(&ring->released)) return NULL;
    if (seen == state_of(tick, LOST) || !atomic_compare_exchange_strong(&slot->state, &seen, state_of(tick, COMPUTING)))
        return NULL; /* only the pacing thread can have changed it, to LOST */
    atomic_store(&slot->busy, 1);
    slot->tick = (struct ring_tick){0};
    slot->n_frames = slot->first_seq = 0;
    return slot;
}

void ring_begin(struct ring_slot *slot)
{
    free(slot->longer);
    slot->longer = NULL;
    slot->tick = (struct ring_tick){.bytes = slot->store};
}

static size_t room_of(const struct ring_slot *slot)
{
    return slot->longer != NULL ? slot->longer_room : slot->store_room;
}

/* Gives a tick memory of its own, or changes the size of that memory. */
static int ring_resize(struct ring_slot *slot, size_t bytes)
{
    uint8_t *longer = realloc(slot->longer, bytes);
    if (longer == NULL) return SH_ENOMEM;
    if (slot->longer == NULL && slot->tick.len != 0) memcpy(longer, slot->tick.bytes, slot->tick.len);
    slot->longer = slot->tick.bytes = longer;
    slot->longer_room = bytes;
    return SH_OK;
}

/* Room doubles, so that a long tick moves a few times only. */
int ring_grow(struct ring_slot *slot, size_t more, size_t *room)
{
    const size_t had = room_of(slot), need = slot->tick.len + more;
    if (need > had && ring_resize(slot, round_up(need > 2 * had ? need : 2 * had)) != SH_OK) return SH_ENOMEM;
    *room = room_of(slot) - slot->tick.len;
    return SH_OK;
}

int ring_break(struct ring_slot *slot)
{
    slot->tick = (struct ring_tick){.broken = 1};
    return SH_ENOMEM;
}

int ring_end(struct ring_slot *slot)
{
    struct ring_tick *tick = &slot->tick;
    const size_t align = _Alignof(struct ring_mark), marks_len = tick->n_marks * sizeof *tick->mark;
    const size_t marks_at = (tick->len + align - 1) / align * align;
    size_t room;
    if (ring_grow(slot, marks_at - tick->len + marks_len, &room) != SH_OK) return ring_break(slot);
    if (slot->longer != NULL) ring_resize(slot, round_up(marks_at + marks_len)); /* where it can't shrink, it stays */
    struct ring_mark *mark = marks_len != 0 ? (struct ring_mark *)(void *)(tick->bytes + marks_at) : NULL;
    if (marks_len != 0) memcpy(mark, tick->mark, marks_len);
    tick->mark = mark;
    return SH_OK;
}

int ring_put(struct ring_slot *slot, const struct ring_tick *tick)
{
    size_t room;
    ring_begin(slot);
    if (ring_grow(slot, tick->len, &room) != SH_OK) return ring_break(slot);
    uint8_t *bytes = slot->tick.bytes;
    if (tick->len != 0) memcpy(bytes, tick->bytes, tick->len);
    slot->tick = *tick;
    slot->tick.bytes = bytes;
    return ring_end(slot);
}

int ring_ready(struct ring_slot *slot, uint64_t tick)
{
    uint64_t seen = state_of(tick, COMPUTING);
    int ready = atomic_compare_exchange_strong(&slot->state, &seen, state_of(tick, READY));
    atomic_store(&slot->busy, 0);
    return ready;
}

void ring_drop(struct ring_slot *slot)
{
    atomic_store(&slot->busy, 0);
}

struct ring_slot *ring_peek(struct ring *ring, uint64_t tick)
{
    struct ring_slot *slot = slot_of(ring, tick);
    return atomic_load(&slot->state) == state_of(tick, READY) ? slot : NULL;
}

void ring_release(struct ring *ring, uint64_t tick)
{
    atomic_store(&ring->released, tick + 1);
}

int ring_lose(struct ring *ring, uint64_t tick)
{
    struct ring_slot *slot = slot_of(ring, tick);
    uint64_t seen = atomic_load(&slot->state);
    do {
        if (seen == state_of(tick, READY)) return 0;
    } while (!atomic_compare_exchange_weak(&slot->state, &seen, state_of(tick, LOST)));
    ring_release(ring, tick);
    return 1;
}

enum ring_read ring_look(struct ring *ring, int reader, uint64_t tick, struct ring_copy *copy)
{
    uint64_t released = atomic_load(&ring->released);
    if (tick >= released) return RING_NONE;
    atomic_store(&ring->hazard[reader], tick + 1);
    /* Read `released` again after setting the hazard: a claim that did not see the hazard comes only once the tick is
     * too old to read. */
    released = atomic_load(&ring->released);
    struct ring_slot *slot = slot_of(ring, tick);
    if (tick + ring->queue_ticks < released || atomic_load(&slot->state) != state_of(tick, READY)) return RING_LOST;
    copy->buf = slot->tick.bytes;
    copy->len = slot->tick.len;
    copy->n_frames = slot->n_frames;
    copy->first_seq = slot->first_seq;
    copy->n_cast = slot->tick.n_cast;
    copy->pulses_before = slot->pulses_before;
    copy->shift_ns = slot->tick.shift_ns;
    return RING_READ;
}

void ring_leave(struct ring *ring, int reader)
{
    atomic_store(&ring->hazard[reader], 0);
}

enum ring_read ring_read(struct ring *ring, int reader, uint64_t tick, struct ring_copy *copy)
{
    uint8_t *to = copy->buf;
    enum ring_read result = ring_look(ring, reader, tick, copy);
    if (result == RING_READ && copy->len != 0 && copy->len <= copy->cap) memcpy(to, copy->buf, copy->len);
    copy->buf = to;
    ring_leave(ring, reader);
    return result;
}
