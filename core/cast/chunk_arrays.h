/* SPDX-License-Identifier: MIT */
/* Private to core/cast: how many pulses are worked on at a time, and the sizes of the arrays for them. */
#ifndef CORE_CAST_CHUNK_ARRAYS_H
#define CORE_CAST_CHUNK_ARRAYS_H

#include "core/cast.h"

/* Pulses worked on at a time: the arrays fit into the second-level cache while the hits' planes are fetched. */
enum { CHUNK = BVH_CHUNK, CAST_FOUND = CHUNK * CAST_MAX_DEPTH };
/* Arrays whose distance is a power of two, or a page, would collide in a cache. */
enum { CHUNK_ROOM = CHUNK + 48, CAST_LIST = CHUNK * LINE_MAX_ECHOES + 80 };

struct chunk_vectors {
    double x[CHUNK_ROOM], y[CHUNK_ROOM], z[CHUNK_ROOM];
};
struct list_vectors {
    double x[CAST_LIST], y[CAST_LIST], z[CAST_LIST];
};

#endif
