/* Private to core/sight: how rays are looked up. */
#ifndef CORE_SIGHT_HITS_INSIDE_H
#define CORE_SIGHT_HITS_INSIDE_H

#include "core/sight/sight_inside.h"

/* Rays ray[0 .. n-1], whose leaves are lists -> their triangles, BVH_NO_TRIANGLE for nothing. Those that the records
 * can't decide come first in ray afterwards, and have no triangle yet. Returns how many. */
uint32_t few_decide(const struct sight *sight, const struct vec3_in *dir, const uint32_t *leaf, uint32_t *ray,
                    uint32_t n, uint32_t *triangle);

#endif
