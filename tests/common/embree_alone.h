/* SPDX-License-Identifier: MIT */
/* Embree as it comes, which the cast is compared with. The mesh has shared vertices, rounded to float in the frame of
 * an origin. Float rays go in packets, and the range is Embree's. Lengths are in metres. */
#ifndef TESTS_COMMON_EMBREE_ALONE_H
#define TESTS_COMMON_EMBREE_ALONE_H

#include "core/embree.h"
#include "core/scene.h"

enum embree_feed {
    EMBREE_PREPARED, /* packets lie in memory, ready; only tfar and geomID are set again */
    EMBREE_LOADED,   /* one packet, filled from arrays of directions */
};
struct embree_alone {
    RTCDevice device;
    RTCScene rtc;
    double build_s;
    float ray_origin[3], range_max_m; /* relative to the origin */
    uint32_t n;                       /* rays below */
    const float *fx, *fy, *fz;        /* of the rays; not owned */
    uint32_t width;                   /* of the packets that lie ready; 0: none */
    void *packets;
    uint32_t *prim; /* results of EMBREE_LOADED */
    float *t;
};
struct embree_alone_spec {
    double origin_m[3]; /* of the float coordinates */
    int robust;         /* Embree's flag */
    int medium;         /* build quality; else high */
    unsigned threads;   /* of the build; 0: all */
    float range_max_m;
};
/* The rays begin at the origin. To begin elsewhere, set ray_origin. The caller must release it with
 * embree_alone_free. */
int embree_alone_create(const struct scene *scene, const struct embree_alone_spec *spec, struct embree_alone *out,
                        struct sh_err *err);
/* Takes n rays from the origin. The arrays stay the caller's, and n is a multiple of 16. */
int embree_alone_rays(struct embree_alone *e, const float *fx, const float *fy, const float *fz, uint32_t n,
                      struct sh_err *err);
/* Prepares passes of this width (1, 4, 8 or 16) and feed. */
int embree_alone_prepare(struct embree_alone *e, uint32_t width, enum embree_feed feed, struct sh_err *err);
/* Call it after the rays' directions have changed: it copies them into the prepared packets. */
void embree_alone_refill(const struct embree_alone *e);
/* Casts the rays first .. first+n-1 (multiples of 16). With EMBREE_LOADED the results are in prim and t. */
void embree_alone_pass(const struct embree_alone *e, uint32_t width, enum embree_feed feed, uint32_t first, uint32_t n);
void embree_alone_free(struct embree_alone *e);

#endif
