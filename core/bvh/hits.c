/* SPDX-License-Identifier: MIT */
/* Exact hits of rays, chunk by chunk. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/bvh/bvh_inside.h"
#include "core/bvh/packet.h"
#include "core/vecmath.h"

enum { ROOM = BVH_CHUNK + 48 }; /* arrays of a power of two would collide in a cache */

struct bvh_work {
    struct bvh_query query;
    struct bvh_nested nested; /* touched only where there are copies */
    struct {
        float x[ROOM], y[ROOM], z[ROOM];
    } dir, org; /* as Embree gets them */
    struct {
        double x[ROOM], y[ROOM], z[ROOM];
    } own; /* origins, local frame */
    double start_m[ROOM];
    struct bvh_profile *profile;
};

static void begin_work(struct bvh_work *w)
{
    memset(w, 0, sizeof *w);
    w->query.nested = &w->nested;
}

int bvh_work_create(struct bvh_work **out, struct sh_err *err)
{
    struct bvh_work *w = *out = aligned_alloc(64, (sizeof *w + 63) / 64 * 64);
    if (w == NULL) return sh_fail(err, SH_ENOMEM, "bvh: no memory");
    begin_work(w);
    return SH_OK;
}

void bvh_work_free(struct bvh_work *work)
{
    free(work);
}

void bvh_work_set_profile(struct bvh_work *work, struct bvh_profile *profile)
{
    work->profile = profile;
}

const struct bvh_counters *bvh_work_counters(const struct bvh_work *work)
{
    return &work->query.counters;
}

struct vec3_floats bvh_work_directions(const struct bvh_work *w)
{
    return (struct vec3_floats){w->dir.x, w->dir.y, w->dir.z};
}

void bvh_work_set_directions(struct bvh_work *w, const struct vec3_in *dir, uint32_t n)
{
    bvh_to_float(dir, n, w->dir.x, w->dir.y, w->dir.z);
}

struct bvh_profile *bvh_work_profile(const struct bvh_work *work)
{
    return work->profile;
}

enum { LANES = 16 };

/* Takes n <= LANES origins of rays into the local frame, from ray `at` on. far2[k] is the largest squared distance to
 * that frame's origin of all points that lane k has had. */
VEC_INLINE void take_lanes(struct bvh_work *w, const struct vec3_in *p, const double origin_m[3], uint32_t at,
                           uint32_t n, double far2[LANES])
{
    const double *px = p->x + at, *py = p->y + at, *pz = p->z + at;
    double *x = w->own.x + at, *y = w->own.y + at, *z = w->own.z + at;
    float *fx = w->org.x + at, *fy = w->org.y + at, *fz = w->org.z + at;
    const double ox = origin_m[0], oy = origin_m[1], oz = origin_m[2];
    VEC_LOOP
    for (uint32_t k = 0; k < n; k++) {
        const double lx = px[k] - ox, ly = py[k] - oy, lz = pz[k] - oz, d2 = lx * lx + ly * ly + lz * lz;
        x[k] = lx;
        y[k] = ly;
        z[k] = lz;
        fx[k] = (float)lx;
        fy[k] = (float)ly;
        fz[k] = (float)lz;
        far2[k] = d2 > far2[k] ? d2 : far2[k];
    }
}

/* Takes the rays' own origins into the local frame, in double, and in float for Embree. Returns the largest of their
 * distances from that frame's origin. */
VEC_CLONES
static double take_own(struct bvh_work *w, const struct bvh *bvh, const struct bvh_rays *rays, struct bvh_batch *batch)
{
    const struct vec3_in p = rays->from.own;
    double far2[LANES] = {0.0}, most2 = 0.0;
    uint32_t i = 0;
    for (; i + LANES <= rays->n; i += LANES)
        take_lanes(w, &p, bvh->origin_m, i, LANES, far2);
    take_lanes(w, &p, bvh->origin_m, i, rays->n - i, far2);
    for (int k = 0; k < LANES; k++)
        most2 = far2[k] > most2 ? far2[k] : most2;
    batch->local.own = VEC3_IN(w->own, 0);
    batch->org = (struct vec3_floats){w->org.x, w->org.y, w->org.z};
    return sqrt(most2);
}

/* A ray that begins outside of the sphere around the scene hits nothing before it has gone as far as that sphere is
 * away. The ray that Embree gets begins after this distance. */
static void take_along(struct bvh_work *w, const struct bvh *bvh, const struct bvh_rays *rays, struct bvh_batch *batch)
{
    for (uint32_t i = 0; i < rays->n; i++) {
        const double dir[3] = VEC3_AT(rays->dir, i);
        double o[3];
        bvh_origin_of(&batch->local, i, o);
        w->start_m[i] = fmax(0.0, vec3_length(o) - bvh->radius_m);
        w->org.x[i] = (float)(o[0] + w->start_m[i] * dir[0]);
        w->org.y[i] = (float)(o[1] + w->start_m[i] * dir[1]);
        w->org.z[i] = (float)(o[2] + w->start_m[i] * dir[2]);
    }
    batch->org = (struct vec3_floats){w->org.x, w->org.y, w->org.z};
    batch->start_m = w->start_m;
}

/* Sets where rays begin, for Embree and for the leaves. */
static void set_origins(struct bvh_work *w, const struct bvh *bvh, const struct bvh_rays *rays, struct bvh_batch *batch)
{
    vec3_sub(rays->from.at_m, bvh->origin_m, batch->local.at_m);
    const double far_m = rays->from.own.x != NULL ? take_own(w, bvh, rays, batch) : vec3_length(batch->local.at_m);
    if (far_m > bvh->radius_m) take_along(w, bvh, rays, batch);
}

/* Ray i of a chunk has hit nothing in its first stretch: casts the next ones, until the ray has left the
 * scene. */
static void cast_further(struct bvh_work *w, const struct bvh *bvh, const struct bvh_batch *batch, uint32_t i)
{
    const struct bvh_rays *rays = batch->rays;
    const double dir[3] = VEC3_AT(rays->dir, i);
    struct bvh_rays one = bvh_rays_chunk(rays, i);
    float at[3];
    double o[3], start_m = batch->start_m != NULL ? batch->start_m[i] : 0.0;
    struct bvh_batch next = *batch;
    bvh_origin_of(&batch->local, i, o);
    if (rays->from.own.x != NULL) next.local.own = VEC3_IN(batch->local.own, i);
    one.n = 1;
    one.scattered = 1;
    next.rays = &one;
    next.dir = (struct vec3_floats){batch->dir.x + i, batch->dir.y + i, batch->dir.z + i};
    next.org = (struct vec3_floats){&at[0], &at[1], &at[2]};
    next.start_m = &start_m;
    const double end_m = fmin(rays->range_max_m, vec3_length(o) + bvh->radius_m);
    while (one.triangle[0] == BVH_NO_TRIANGLE && (start_m += bvh->stretch_m) < end_m) {
        for (int k = 0; k < 3; k++)
            at[k] = (float)(o[k] + start_m * dir[k]);
        bvh_intersect(bvh, &w->query, &next);
    }
}

static void cast_chunk(struct bvh_work *w, const struct bvh *bvh, const struct bvh_rays *rays)
{
    const int in_stretches = rays->range_max_m > bvh->stretch_m;
    struct bvh_batch batch = {.rays = rays,
                              .dir = bvh_work_directions(w),
                              .t_max = (float)(in_stretches ? bvh->stretch_m : rays->range_max_m * 1.001),
                              .most_m = in_stretches ? bvh->stretch_m : INFINITY};
    bvh_work_set_directions(w, &rays->dir, rays->n);
    set_origins(w, bvh, rays, &batch);
    bvh_stage_ends(w->profile, BVH_STAGE_PREPARE);
    bvh_intersect(bvh, &w->query, &batch);
    for (uint32_t i = 0; in_stretches && i < rays->n; i++)
        if (rays->triangle[i] == BVH_NO_TRIANGLE) cast_further(w, bvh, &batch, i);
    bvh_stage_ends(w->profile, BVH_STAGE_EMBREE);
    bvh_refine(bvh, rays);
    bvh_stage_ends(w->profile, BVH_STAGE_REFINE);
}

void bvh_hits(struct bvh_work *work, const struct bvh *bvh, const struct bvh_rays *rays)
{
    for (uint32_t at = 0; at < rays->n; at += BVH_CHUNK) {
        const struct bvh_rays part = bvh_rays_chunk(rays, at);
        cast_chunk(work, bvh, &part);
    }
}

double bvh_ray(const struct bvh *bvh, const double at_m[3], const double dir[3])
{
    struct bvh_work work;
    double range_m;
    uint32_t triangle;
    const struct bvh_rays ray = {.n = 1,
                                 .from.at_m = {at_m[0], at_m[1], at_m[2]},
                                 .dir = {&dir[0], &dir[1], &dir[2]},
                                 .range_max_m = 1e9,
                                 .scattered = 1,
                                 .range_m = &range_m,
                                 .triangle = &triangle};
    begin_work(&work);
    bvh_hits(&work, bvh, &ray);
    return range_m;
}
