/* SPDX-License-Identifier: MIT */
/* Private to core/bvh: a copy of a mesh is a primitive of the scene's BVH. Each mesh has a BVH of its own. */
#ifndef CORE_BVH_COPIES_H
#define CORE_BVH_COPIES_H

#include "core/bvh.h"
#include "core/embree.h"

/* Makes the BVHs of meshes that have copies. */
int bvh_make_copies(struct bvh *bvh, unsigned threads, const struct sh_report *report, struct sh_err *err);
void bvh_free_copies(struct bvh *bvh);
/* Embree calls these: for the box of a copy, and where a packet reaches a copy. */
void embree_asks_copy_bounds(const struct RTCBoundsFunctionArguments *args);
void bvh_meet_copy(const struct RTCIntersectFunctionNArguments *args);

/* Steepness and cosines where there are copies. */
void bvh_steepness_copies(const struct bvh *bvh, const struct bvh_rays *rays);
void bvh_cosines_copies(const struct bvh *bvh, const uint32_t *triangle, const struct vec3_in *dir, uint32_t n,
                        double *cosine);

#endif
