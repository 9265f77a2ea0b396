/* SPDX-License-Identifier: MIT */
/* Numbers for keys of 128 bits: 0, 1, 2 ... in the order in which the keys come. A hash table of open addressing. */
#ifndef CORE_STUDIO_MESH_NUMBERING_H
#define CORE_STUDIO_MESH_NUMBERING_H

#include "core/grow.h"
#include "core/rng.h"

#define NUMBERING_NONE UINT32_MAX

struct numbering {
    uint64_t (*key)[2]; /* [n] */
    uint32_t n;
    uint32_t *slot; /* [n_slots] a number; NUMBERING_NONE: free */
    size_t n_slots, key_room;
};

/* Returns the slot of a key, or the free one that it would get. n_slots is a power of two, and a slot is free. */
static inline size_t numbering_slot(const struct numbering *t, const uint64_t key[2])
{
    const size_t mask = t->n_slots - 1;
    size_t at = (size_t)rng_mix(key[0] + 0x9e3779b97f4a7c15ULL * rng_mix(key[1])) & mask;
    while (t->slot[at] != NUMBERING_NONE && memcmp(t->key[t->slot[at]], key, sizeof *t->key) != 0)
        at = (at + 1) & mask;
    return at;
}

static inline int numbering_enlarge(struct numbering *t)
{
    const size_t n_slots = t->n_slots != 0 ? 2 * t->n_slots : 1 << 12;
    if (!resize(&t->slot, n_slots, sizeof *t->slot)) return 0;
    t->n_slots = n_slots;
    memset(t->slot, 0xff, n_slots * sizeof *t->slot);
    for (uint32_t i = 0; i < t->n; i++)
        t->slot[numbering_slot(t, t->key[i])] = i;
    return 1;
}

/* Returns the number of a key. A new key gets t->n, which then grows by 1. NUMBERING_NONE: no memory. */
static inline uint32_t numbering_of(struct numbering *t, const uint64_t key[2])
{
    if (2 * ((size_t)t->n + 1) > t->n_slots && !numbering_enlarge(t)) return NUMBERING_NONE;
    uint32_t *number = &t->slot[numbering_slot(t, key)];
    if (*number != NUMBERING_NONE) return *number;
    if (!grow(&t->key, &t->key_room, (size_t)t->n + 1, sizeof *t->key)) return NUMBERING_NONE;
    memcpy(t->key[t->n], key, sizeof *t->key);
    return *number = t->n++;
}

static inline void numbering_clear(struct numbering *t)
{
    if (t->n_slots > 0) memset(t->slot, 0xff, t->n_slots * sizeof *t->slot);
    t->n = 0;
}

static inline void numbering_free(const struct numbering *t)
{
    free(t->key);
    free(t->slot);
}

#endif
