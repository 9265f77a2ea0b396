/* Private to core/bvh: the nearest hit of a ray so far, and those that count as the same. */
#ifndef CORE_BVH_NEAREST_H
#define CORE_BVH_NEAREST_H

#include "core/bvh/bvh_inside.h"
#include "core/vecmath.h"

/* As near as the nearest: all of them are kept, and the lowest number is the hit. */
static inline void add_tied(struct bvh_query *query, uint32_t lane, uint32_t triangle, double range_m)
{
    struct bvh_tied *tied = &query->tied[lane];
    const double most_m = query->range_m[lane] + BVH_SAME * query->range_m[lane];
    uint32_t n = 0, last = 0, lowest = 0, before = query->n_tied[lane];
    if (before == 0) {
        tied->triangle[0] = query->triangle[lane];
        tied->range_m[0] = query->hit_m[lane];
        before = 1;
    }
    for (uint32_t i = 0; i < before; i++) {
        if (tied->range_m[i] > most_m || tied->triangle[i] == triangle) continue;
        tied->range_m[n] = tied->range_m[i];
        tied->triangle[n] = tied->triangle[i];
        if (tied->triangle[n] > tied->triangle[last]) last = n;
        n++;
    }
    const uint32_t at = n < BVH_MOST_TIED ? n : last;
    if (n < BVH_MOST_TIED || triangle < tied->triangle[last]) {
        tied->triangle[at] = triangle;
        tied->range_m[at] = range_m;
        n += at == n;
    }
    query->n_tied[lane] = n;
    for (uint32_t i = 1; i < n; i++)
        if (tied->triangle[i] < tied->triangle[lowest]) lowest = i;
    query->triangle[lane] = tied->triangle[lowest];
    query->hit_m[lane] = tied->range_m[lowest];
}

/* The next float above a number that is not negative. */
VEC_INLINE float float_above(double x)
{
    const float f = (float)x;
    uint32_t bits;
    memcpy(&bits, &f, sizeof bits);
    bits += (double)f <= x;
    float above;
    memcpy(&above, &bits, sizeof above);
    return above;
}

/* A hit at a range that is no further than the nearest and what counts as the same. */
VEC_INLINE void bvh_take_hit(struct bvh_query *query, float *tfar, uint32_t lane, uint32_t triangle, double range_m)
{
    const double nearest_m = query->range_m[lane];
    if (range_m < nearest_m) {
        query->range_m[lane] = range_m;
        *tfar = float_above(range_m - query->start_m[lane]);
    }
    if (range_m + BVH_SAME * range_m < nearest_m) {
        query->n_tied[lane] = 0;
        query->triangle[lane] = triangle;
        query->hit_m[lane] = range_m;
        return;
    }
    add_tied(query, lane, triangle, range_m);
}

#endif
