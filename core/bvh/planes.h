/* SPDX-License-Identifier: MIT */
/* Private to core/bvh: planes of triangles, in double; labels and steepness of rays. */
#ifndef CORE_BVH_PLANES_H
#define CORE_BVH_PLANES_H

#include "core/bvh.h"

void bvh_set_plane(const struct bvh *bvh, uint32_t triangle, struct bvh_plane *plane);
/* Notes where the leaves have the plane of each triangle: at_plane. */
int bvh_find_planes(struct bvh *bvh, const struct sh_report *report, struct sh_err *err);
/* Fills labels and steepness of all rays; those that hit nothing get the values of a miss. */
void bvh_refine(const struct bvh *bvh, const struct bvh_rays *rays);

#endif
