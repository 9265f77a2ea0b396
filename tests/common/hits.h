/* SPDX-License-Identifier: MIT */
/* Exact hits of rays that begin at one point. The rays' directions are three arrays. */
#ifndef TESTS_COMMON_HITS_H
#define TESTS_COMMON_HITS_H

#include "core/cast.h"

void hits_from(struct caster *caster, const struct bvh *bvh, const double from_m[3], double range_max_m, uint32_t n,
               const double *dx, const double *dy, const double *dz, double *range_m, uint32_t *triangle);

#endif
