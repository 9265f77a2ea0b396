/* SPDX-License-Identifier: MIT */
/* Private to core/surface. Finds a label that has the same image already, in a time that does not grow with the number
 * of labels. In: a hash of the image, and a comparison. */
#ifndef CORE_SURFACE_FOUND_H
#define CORE_SURFACE_FOUND_H

#include <stdint.h>
#include <stdlib.h>

struct surface_found {
    uint32_t room;   /* a power of two, at least twice the number of labels */
    uint32_t slot[]; /* [room] 1 + label; 0: free */
};

/* Returns the slot with a label for which is_same(ctx, label) is not 0, or the free slot for the first such label. n:
 * labels that there can be. NULL: no memory. *begun, NULL at first, is freed by free(). */
static inline uint32_t *surface_found_slot(struct surface_found **begun, uint32_t n, uint64_t hash,
                                           int (*is_same)(const void *ctx, uint32_t label), const void *ctx)
{
    if (*begun == NULL) {
        uint32_t room = 2;
        while (room < 2 * (n + 1))
            room *= 2;
        *begun = calloc(1, sizeof **begun + room * sizeof(uint32_t));
        if (*begun == NULL) return NULL;
        (*begun)->room = room;
    }
    struct surface_found *found = *begun;
    uint32_t at = (uint32_t)hash & (found->room - 1);
    while (found->slot[at] != 0 && !is_same(ctx, found->slot[at] - 1))
        at = (at + 1) & (found->room - 1);
    return &found->slot[at];
}

#endif
