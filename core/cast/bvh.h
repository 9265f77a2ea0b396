/* Private to core/cast: the BVH with the exact planes beside it. */
#ifndef CORE_CAST_BVH_H
#define CORE_CAST_BVH_H

#include "core/cast.h"
#include "core/embree.h"

/* Unit normal and distance of a triangle's plane in the local frame: n . p = d. One cache line holds two. */
struct bvh_plane {
    double n[3], d;
};

struct bvh {
    RTCDevice device;
    RTCScene rtc;
    const struct scene *scene;
    struct bvh_plane *plane;
    double origin_m[3];
    double reach_m;       /* largest |coordinate| in the local frame */
    struct bvh_info info;
    int64_t bytes;        /* as Embree reports */
};

/* Rays of one chunk in arrays; prim is RTC_INVALID_GEOMETRY_ID for a miss, t Embree's own distance. */
struct bvh_rays {
    float org[3], t_max;
    const double *dx, *dy, *dz;
    uint32_t *prim;
    float *t;
};

/* Casts n rays from one origin, in packets of the native width, ragged ends masked. */
void bvh_intersect(const struct bvh *bvh, const struct bvh_rays *rays, uint32_t n);

/* Range of the point of triangle `prim` nearest to the ray o + t*dir: for a ray that Embree puts just inside and double
 * precision just outside of a triangle seen at a grazing angle, where the plane runs away from the triangle. */
double bvh_clamped_range(const struct bvh *bvh, uint32_t prim, const double o_local[3], const double dir[3]);

#endif
