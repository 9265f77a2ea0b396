/* SPDX-License-Identifier: MIT */
/* Arrays that grow. In: an array, and how many elements it must hold. Out: the array, moved where it had to
 * be. */
#ifndef CORE_GROW_H
#define CORE_GROW_H

#include <stdbool.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

/* Room for `need` elements of `size` bytes in *array (a pointer to the array's pointer, from malloc or NULL),
 * with room to spare; *room is what there is. false: no memory, and the array is as it was. */
static inline bool grow(void *array, size_t *room, size_t need, size_t size)
{
    if (need <= *room) return true;
    size_t more = need + need / 2 + 64;
    void *old, *bigger;
    memcpy(&old, array, sizeof old);
    if (more > SIZE_MAX / size || (bigger = realloc(old, more * size)) == NULL) return false;
    memcpy(array, &bigger, sizeof bigger);
    *room = more;
    return true;
}

#endif
