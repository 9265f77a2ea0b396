/* SPDX-License-Identifier: MIT */
/* Private to core/bvh: the nearest hit of a ray so far, and those that count as the same. */
#ifndef CORE_BVH_NEAREST_H
#define CORE_BVH_NEAREST_H

#include "core/bvh/packet.h"
#include "core/bytes.h"
#include "core/vecmath.h"

/* The next float above a number that is not negative. */
VEC_INLINE float float_above(double x)
{
    const float f = (float)x;
    return bits_float(float_bits(f) + ((double)f <= x));
}

/* Ties have to be found, too. So tfar lies beyond the nearest hit and all that count as equally near. */
VEC_INLINE float tfar_of(double nearest_m, double start_m)
{
    return float_above(nearest_m + BVH_SAME * nearest_m - start_m);
}

/* Takes a hit that counts as equal to the nearest: the lowest number wins. The stored hit may have turned out to be too
 * far to count as equal. Its low number may then have kept out a hit that does, so the ray is cast again
 * (packet.c). */
static inline void add_tied(struct bvh_query *query, uint32_t lane, uint32_t triangle, double range_m)
{
    const double nearest_m = query->range_m[lane];
    const int is_past = query->hit_m[lane] > nearest_m + BVH_SAME * nearest_m;
    query->unsure |= (uint32_t)is_past << lane;
    if (!is_past && triangle >= query->triangle[lane]) return;
    query->triangle[lane] = triangle;
    query->hit_m[lane] = range_m;
}

/* Takes a hit at range_m. first_m is the nearest range of the hits that count as equal to this one: for a triangle
 * range_m itself, for a copy of a mesh the nearest range in the copy or so far. first_m is no further than the nearest
 * range so far, or counts as equal to that range. */
VEC_INLINE void bvh_take_hit(struct bvh_query *query, float *tfar, uint32_t lane, uint32_t triangle, double range_m,
                             double first_m)
{
    const double nearest_m = query->range_m[lane];
    if (first_m < nearest_m) {
        query->range_m[lane] = first_m;
        *tfar = tfar_of(first_m, query->start_m[lane]);
    }
    if (first_m + BVH_SAME * first_m < nearest_m) {
        query->triangle[lane] = triangle;
        query->hit_m[lane] = range_m;
        return;
    }
    add_tied(query, lane, triangle, range_m);
}

/* Notes a triangle that the ray misses by no more than the rounding of double at the triangle's edges. If there are
 * several, the nearest one counts; if some are equally near, the one with the lowest number does. */
static inline void bvh_note_miss(struct bvh_query *query, uint32_t lane, uint32_t triangle, double range_m)
{
    const double near_m = query->near_m[lane];
    if (range_m > near_m || (range_m == near_m && triangle > query->near[lane])) return;
    query->near_m[lane] = range_m;
    query->near[lane] = triangle;
}

#endif
