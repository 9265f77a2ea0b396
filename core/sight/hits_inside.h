/* SPDX-License-Identifier: MIT */
/* Private to core/sight: how rays are looked up. Neighbours mostly share a leaf. So rays are cut into runs of one
 * leaf, and each run is decided at once. */
#ifndef CORE_SIGHT_HITS_INSIDE_H
#define CORE_SIGHT_HITS_INSIDE_H

#include "core/sight/sight_inside.h"

enum { HITS_ROOM = BVH_CHUNK + 48 }; /* arrays of a power of two would collide in a cache */

/* Rays from here on, up to the next run, have this leaf. */
struct sight_run {
    uint32_t from, leaf;
};

/* ---- places.c */
struct sight_places {
    int32_t tile[HITS_ROOM], within[HITS_ROOM];
    uint8_t changes[HITS_ROOM];
};
/* Cuts up to BVH_CHUNK rays into runs. Returns how many; one more entry marks the end of the last. */
uint32_t sight_find_runs(const struct sight *sight, const struct vec3_in *dir, uint32_t n, struct sight_places *places,
                         struct sight_run *run);

/* ---- candidate_list.c */
/* Finds which triangle of `list` each of the rays from .. to - 1 hits. triangle[0 ..] gets the hits, BVH_NO_TRIANGLE
 * where a ray hits nothing, and FEW_OPEN where the list can't decide: a ray lies within the error bounds of struct
 * sight_record, at an edge or nearly along a plane, or planes nearly coincide. Returns whether any ray has FEW_OPEN. */
enum { FEW_OPEN = 0xfffffffe };
int candidate_list_decide(const struct sight *sight, const struct bvh_rays *rays, const uint32_t *list, uint32_t from,
                          uint32_t to, uint32_t *triangle);

#endif
