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
    sum->crowded += more->crowded;
    sum->faint += more->faint;
    sum->unfit += more->unfit;
}

int ring_create(struct ring *ring, uint64_t ahead_ticks, uint64_t queue_ticks, uint32_t slot_bytes, struct sh_err *err)
{
    memset(ring, 0, sizeof *ring);
    ring->queue_ticks = queue_ticks;
    ring->n_slots = ahead_ticks + 2 * queue_ticks + 8;
    ring->slot_bytes = (slot_bytes + 63) / 64 * 64;
    ring->slot = calloc(ring->n_slots, sizeof *ring->slot);
    uint8_t *bytes = ring->slot == NULL ? NULL : malloc(ring->n_slots * ring->slot_bytes);
    if (bytes == NULL) {
        free(ring->slot);
        ring->slot = NULL;
        return sh_fail(err, SH_ENOMEM, "loop: no memory for %llu slots of %u bytes; lower loop.queue_ms",
                       (unsigned long long)ring->n_slots, ring->slot_bytes);
    }
    for (uint64_t i = 0; i < ring->n_slots; i++)
        ring->slot[i].bytes = bytes + i * ring->slot_bytes;
    return SH_OK;
}

void ring_free(struct ring *ring)
{
    if (ring->slot == NULL) return;
    free(ring->slot[0].bytes);
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
    while (atomic_load(&slot->busy) || (tick >= ring->n_slots && is_being_read(ring, tick - ring->n_slots)))
        sched_yield();
    uint64_t seen = atomic_load(&slot->state);
    if (seen == state_of(tick, LOST) || !atomic_compare_exchange_strong(&slot->state, &seen, state_of(tick, COMPUTING)))
        return NULL; /* only the pacing thread can have changed it: lost */
    atomic_store(&slot->busy, 1);
    slot->len = slot->n_frames = slot->first_seq = slot->n_marks = 0;
    slot->tail = (struct ring_hits){0};
    slot->wake = 0;
    slot->n_fired = slot->n_cast = slot->n_echoes = slot->n_lines = 0;
    slot->n_crowded = slot->n_faint = slot->n_unfit = 0;
    return slot;
}

int ring_ready(struct ring *ring, struct ring_slot *slot, uint64_t tick)
{
    (void)ring;
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

enum ring_read ring_read(struct ring *ring, int reader, uint64_t tick, uint8_t *buf, uint32_t cap, uint32_t *len,
                         uint32_t *n_frames, uint32_t *first_seq)
{
    uint64_t released = atomic_load(&ring->released);
    if (tick >= released) return RING_NONE;
    atomic_store(&ring->hazard[reader], tick + 1);
    /* Looked at again after the hazard is up: a claim that did not see it comes only once the tick is this old. */
    released = atomic_load(&ring->released);
    struct ring_slot *slot = slot_of(ring, tick);
    enum ring_read result = RING_LOST;
    if (tick + ring->queue_ticks >= released && atomic_load(&slot->state) == state_of(tick, READY)) {
        *len = slot->len;
        *n_frames = slot->n_frames;
        *first_seq = slot->first_seq;
        if (slot->len <= cap) memcpy(buf, slot->bytes, slot->len);
        result = RING_READ;
    }
    atomic_store(&ring->hazard[reader], 0);
    return result;
}
