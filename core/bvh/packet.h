/* SPDX-License-Identifier: MIT */
/* Private to core/bvh: packets of rays that Embree casts, and their state in double for the leaves. */
#ifndef CORE_BVH_PACKET_H
#define CORE_BVH_PACKET_H

#include <math.h>
#include <stddef.h>

#include "core/bvh.h"
#include "core/embree.h"
#include "core/vecmath.h"

/* A surface no further than this from a ray's origin is no hit: the ray begins on it, and goes on. This limit is half
 * of the finest step of ranges and coordinates in the stream (1 um), and far more than the rounding of a range of 0. */
#define BVH_AT_ORIGIN_M 5e-7
/* Ranges that differ by no more than this share of them are the same. */
#define BVH_SAME 1e-12

enum { BVH_PACKET = 16 };

#if RTC_VERSION_MAJOR >= 4
typedef struct RTCRayQueryContext bvh_context;
#else
typedef struct RTCIntersectContext bvh_context;
#endif

/* The state of a packet in double, for the leaves. Embree gives the functions of the leaves a pointer to `context`. As
 * that is the first member, it is also a pointer to the whole struct. */
struct bvh_nested;
struct bvh_query {
    bvh_context context;
    const struct bvh *bvh;
    const struct bvh_leaf *first_leaf; /* its leaves */
    int may_pass;                      /* textures have holes: a ray may pass a triangle that it meets */
    struct bvh_nested *nested;         /* for copies; of a query within a copy: NULL */
    double at_origin_m;                /* no hit is nearer than this */
    uint32_t width;                    /* rays of the call */
    uint32_t unsure;                   /* a bit for each ray that may have another hit of lower number */
    int has_own;                       /* each ray begins at its own point, org; else all begin at `at` */
    int is_turned;                     /* `turned` is set */
    double at[3], at_local[3];         /* prcs; from the BVH's origin. With own points at_local is the first of them */
    double most_m;                     /* greatest length of a float ray; INFINITY: any */
    /* [BVH_PACKET] numbers each, in the arrays of all rays or in `room`. A lane without a ray has any value. */
    const double *dir[3], *org[3], *local[3];
    const float *dir_float; /* [3][width] dir for Embree; BVH_PACKET elements of each may be read */
    /* Each array begins a cache line. */
    double room[9][BVH_PACKET] __attribute__((aligned(64))); /* for dir, org, local */
    float apart_m[BVH_PACKET];                               /* of own points: |x| + |y| + |z| from at_local, rounded */
    float turned[3][BVH_PACKET];   /* of own points, where leaves need them: (local - at_local) x dir */
    double start_m[BVH_PACKET];    /* where the float ray begins, along the ray */
    double range_m[BVH_PACKET];    /* out: the nearest so far; before a hit, the greatest that counts */
    uint32_t triangle[BVH_PACKET]; /* out: the hit */
    double hit_m[BVH_PACKET];      /* out: range of that hit; it counts as equal to range_m */
    double near_m[BVH_PACKET];     /* of the nearest triangle that is missed by rounding alone; INFINITY: none */
    uint32_t near[BVH_PACKET];
    struct bvh_counters counters; /* counted up from packet to packet */
} __attribute__((aligned(64)));

/* A packet within a copy. */
struct bvh_nested {
    struct bvh_query query;
    struct RTCRayHit16 rays; /* or fewer */
    int valid[BVH_PACKET];
} __attribute__((aligned(64)));

/* Finds the array of a field in a packet of `width` rays. A packet has an array of `width` elements for each member of
 * struct RTCRay, in the same order; `name` is that member. Embree has such accessors for C++ alone. */
#define bvh_field(rays, width, name) \
    ((float *)(void *)(rays) + offsetof(struct RTCRay, name) / sizeof(float) * (size_t)(width))
_Static_assert(offsetof(struct RTCRay16, tfar) == 16 * offsetof(struct RTCRay, tfar), "field by field");

/* Sets up Embree's context, and what depends on the BVH alone. */
void bvh_begin_query(struct bvh_query *query, const struct bvh *bvh);
/* Casts `width` rays through the BVH. */
void bvh_call_embree(const struct bvh *bvh, struct bvh_query *query, const int *valid, void *rays, uint32_t width);

/* Forgets the near misses of the packet before. */
static inline void bvh_forget_near(struct bvh_query *query)
{
    for (uint32_t i = 0; i < BVH_PACKET; i++) {
        query->near_m[i] = INFINITY;
        query->near[i] = BVH_NO_TRIANGLE;
    }
}

/* Sets at_local and apart_m of a packet whose rays have points of their own. */
VEC_INLINE void bvh_find_apart(struct bvh_query *query)
{
    const double *px = query->local[0], *py = query->local[1], *pz = query->local[2];
    const double ax = px[0], ay = py[0], az = pz[0];
    VEC_LOOP
    for (uint32_t i = 0; i < BVH_PACKET; i++)
        query->apart_m[i] = (float)(fabs(px[i] - ax) + fabs(py[i] - ay) + fabs(pz[i] - az));
    query->at_local[0] = ax;
    query->at_local[1] = ay;
    query->at_local[2] = az;
    query->is_turned = 0;
}

/* Sets `turned`. */
VEC_INLINE void bvh_turn_origins(struct bvh_query *query)
{
    const double *px = query->local[0], *py = query->local[1], *pz = query->local[2];
    const double *dx = query->dir[0], *dy = query->dir[1], *dz = query->dir[2];
    const double ax = query->at_local[0], ay = query->at_local[1], az = query->at_local[2];
    VEC_LOOP
    for (uint32_t i = 0; i < BVH_PACKET; i++) {
        const double x = px[i] - ax, y = py[i] - ay, z = pz[i] - az;
        query->turned[0][i] = (float)(y * dz[i] - z * dy[i]);
        query->turned[1][i] = (float)(z * dx[i] - x * dz[i]);
        query->turned[2][i] = (float)(x * dy[i] - y * dx[i]);
    }
    query->is_turned = 1;
}

/* Up to BVH_CHUNK rays for bvh_intersect, with their directions and origins in float. */
struct bvh_batch {
    const struct bvh_rays *rays;
    struct vec3_floats dir, org; /* org.x NULL: all at local.at_m */
    const double *start_m;       /* NULL: 0 */
    struct bvh_origins local;    /* from the BVH's origin */
    float t_max;
    double most_m; /* greatest length of a float ray; INFINITY: hits beyond t_max may be missed */
};
void bvh_intersect(const struct bvh *bvh, struct bvh_query *query, struct bvh_batch *batch);

#endif
