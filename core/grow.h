/* SPDX-License-Identifier: MIT */
/* Arrays that grow. In: an array, and how many elements it must hold. Out: the array, which may have moved. */
#ifndef CORE_GROW_H
#define CORE_GROW_H

#include <stdbool.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

/* Makes room for n elements of `size` bytes, one at least. array points to the array's pointer, which is NULL or from
 * malloc. false: there is no memory, and the array is as it was. */
static inline bool resize(void *array, size_t n, size_t size)
{
    void *old, *other;
    memcpy(&old, array, sizeof old);
    if (n > SIZE_MAX / size || (other = realloc(old, (n > 0 ? n : 1) * size)) == NULL) return false;
    memcpy(array, &other, sizeof other);
    return true;
}

/* Returns the size of a hash table for `least` slots or more: a power of two. */
static inline size_t grow_table(uint64_t least)
{
    size_t size = 64;
    while (size < least)
        size *= 2;
    return size;
}

/* Makes room for `need` elements, and some to spare. *room is the number of elements that there is room for. */
static inline bool grow(void *array, size_t *room, size_t need, size_t size)
{
    if (need <= *room) return true;
    size_t more = need + need / 2 + 64;
    if (!resize(array, more, size)) return false;
    *room = more;
    return true;
}

#endif
