/* SPDX-License-Identifier: MIT */
#include "tests/common/hits.h"

void hits_from(struct caster *caster, const struct bvh *bvh, const double from_m[3], double range_max_m, uint32_t n,
               const double *dx, const double *dy, const double *dz, double *range_m, uint32_t *triangle)
{
    const struct bvh_rays rays = {.n = n,
                                  .from.at_m = {from_m[0], from_m[1], from_m[2]},
                                  .dir = {dx, dy, dz},
                                  .range_max_m = range_max_m,
                                  .range_m = range_m,
                                  .triangle = triangle};
    caster_hits(caster, bvh, &rays);
}
