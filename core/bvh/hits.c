/* Exact hits of rays: Embree proposes, double decides; chunk by chunk. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/bvh/bvh_inside.h"
#include "core/vecmath.h"

enum {
    DOUBTS_TOGETHER = 16,  /* passed at once where there are none */
    ROOM = BVH_CHUNK + 48, /* arrays of a power of two would get into each other's way in a cache */
};

struct bvh_work {
    struct bvh_packets packets, placed; /* of rays from one point; each from its own */
    struct {
        float x[ROOM], y[ROOM], z[ROOM];
    } dir, own_float; /* as Embree gets them */
    struct {
        double x[ROOM], y[ROOM], z[ROOM];
    } own; /* origins, local frame */
    uint32_t prim[ROOM], doubt[ROOM], label[ROOM];
    float t[ROOM], u[ROOM], v[ROOM];
    struct bvh_counters counters;
    struct bvh_profile *profile;
};

int bvh_work_create(struct bvh_work **out, struct sh_err *err)
{
    struct bvh_work *w = *out = aligned_alloc(64, (sizeof *w + 63) / 64 * 64);
    if (w == NULL) return sh_fail(err, SH_ENOMEM, "bvh: no memory");
    memset(w, 0, sizeof *w);
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
    return &work->counters;
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

static void set_origin(struct decide_ray *ray, const double at_m[3])
{
    for (int i = 0; i < 3; i++) {
        ray->station_m[i] = at_m[i];
        ray->o_local[i] = at_m[i] - ray->bvh->origin_m[i];
    }
}

static void set_ray(struct decide_ray *ray, const struct bvh_rays *rays, uint32_t i)
{
    const double dir[3] = VEC3_AT(rays->dir, i);
    if (rays->from.own.x != NULL) set_origin(ray, (const double[3])VEC3_AT(rays->from.own, i));
    memcpy(ray->dir, dir, sizeof dir);
}

/* What was decided of ray i, but for its triangle. */
static void put(const struct decide_ray *ray, const struct decide_hit *hit, const struct bvh_rays *rays, uint32_t i)
{
    const int none = hit->prim == RTC_INVALID_GEOMETRY_ID;
    rays->range_m[i] = none ? (double)NAN : hit->range_m;
    if (rays->label != NULL) rays->label[i] = none ? BVH_NO_LABEL : bvh_label(&ray->bvh->triangle[hit->prim]);
    if (rays->steep != NULL) rays->steep[i] = bvh_steep(ray->bvh, hit->prim, ray->dir);
}

static void decide_one(struct bvh_work *w, struct decide_ray *ray, const struct bvh_rays *rays, uint32_t i)
{
    struct decide_hit hit = {w->prim[i], rays->range_m[i]};
    set_ray(ray, rays, i);
    if (w->doubt[i] & BVH_DOUBT_BORDER)
        decide_hit(ray, w->prim[i], w->t[i], &w->counters, &hit);
    else
        decide_again(ray, &hit);
    w->prim[i] = hit.prim;
    put(ray, &hit, rays, i);
}

/* Doubts are few: whole groups without any are passed at once. Each costs a chain of cache misses, so they
 * are looked up together. */
static void decide(struct bvh_work *w, struct decide_ray *ray, const struct bvh_rays *rays)
{
    uint32_t doubts = 0, in_doubt[BVH_CHUNK];
    for (uint32_t base = 0; base < rays->n; base += DOUBTS_TOGETHER) {
        uint32_t any = 0, end = rays->n - base < DOUBTS_TOGETHER ? rays->n : base + DOUBTS_TOGETHER;
        for (uint32_t i = base; i < base + DOUBTS_TOGETHER; i++)
            any |= w->doubt[i]; /* beyond n: stale, but there; a doubt too many costs a look */
        for (uint32_t i = base; any != 0 && i < end; i++)
            if (w->doubt[i]) in_doubt[doubts++] = i;
    }
    if (doubts == 0) return;
    decide_prefetch(ray->bvh, w->prim, in_doubt, doubts);
    for (uint32_t k = 0; k < doubts; k++)
        decide_one(w, ray, rays, in_doubt[k]);
}

VEC_CLONES
static void to_local(const struct vec3_in *own, const double origin_m[3], uint32_t n, const struct vec3_out *out)
{
    const struct vec3_in p = *own;
    const struct vec3_out o = *out;
    const double x = origin_m[0], y = origin_m[1], z = origin_m[2];
    VEC_LOOP
    for (uint32_t i = 0; i < n; i++) {
        o.x[i] = p.x[i] - x;
        o.y[i] = p.y[i] - y;
        o.z[i] = p.z[i] - z;
    }
}

/* One chunk: what Embree proposes and double precision makes of it. */
static void cast_chunk(struct bvh_work *w, struct decide_ray *ray, const struct bvh_rays *rays)
{
    const struct bvh *bvh = ray->bvh;
    const uint32_t n = rays->n;
    struct bvh_batch batch = {.t_max = ray->t_max,
                              .scattered = rays->scattered,
                              .begins = rays->begins,
                              .dir = bvh_work_directions(w),
                              .prim = w->prim,
                              .t = w->t,
                              .u = w->u,
                              .v = w->v};
    struct bvh_proposals proposals = {.bvh = bvh,
                                      .n = n,
                                      .dir = rays->dir,
                                      .prim = w->prim,
                                      .u = w->u,
                                      .v = w->v,
                                      .range_m = rays->range_m,
                                      .label = rays->label != NULL ? rays->label : w->label,
                                      .steep = rays->steep,
                                      .doubt = w->doubt};
    for (int i = 0; i < 3; i++) {
        batch.org[i] = (float)ray->o_local[i];
        proposals.o[i] = ray->o_local[i];
    }
    bvh_to_float(&rays->dir, n, w->dir.x, w->dir.y, w->dir.z);
    if (rays->from.own.x != NULL) {
        proposals.own = VEC3_IN(w->own, 0);
        to_local(&rays->from.own, bvh->origin_m, n, &VEC3_OUT(w->own, 0));
        bvh_to_float(&proposals.own, n, w->own_float.x, w->own_float.y, w->own_float.z);
        batch.own = (struct vec3_floats){w->own_float.x, w->own_float.y, w->own_float.z};
    }
    bvh_stage_ends(w->profile, BVH_STAGE_PREPARE);
    bvh_intersect(bvh, batch.own.x != NULL ? &w->placed : &w->packets, &batch, n);
    bvh_stage_ends(w->profile, BVH_STAGE_EMBREE);
    uint32_t doubts = bvh_refine(&proposals);
    bvh_stage_ends(w->profile, BVH_STAGE_REFINE);
    if (doubts != 0) decide(w, ray, rays);
    memcpy(rays->triangle, w->prim, n * sizeof *rays->triangle);
    bvh_stage_ends(w->profile, BVH_STAGE_DECIDE);
}

static struct decide_ray ray_from(const struct bvh *bvh, const struct bvh_rays *rays)
{
    struct decide_ray ray = {.bvh = bvh, .t_max = (float)(rays->range_max_m * 1.001)};
    set_origin(&ray, rays->from.at_m);
    return ray;
}

void bvh_hits(struct bvh_work *work, const struct bvh *bvh, const struct bvh_rays *rays)
{
    struct decide_ray ray = ray_from(bvh, rays);
    for (uint32_t at = 0; at < rays->n; at += BVH_CHUNK) {
        struct bvh_rays part = *rays;
        part.n = rays->n - at < BVH_CHUNK ? rays->n - at : BVH_CHUNK;
        part.dir = VEC3_IN(rays->dir, at);
        part.begins = rays->begins != NULL ? rays->begins + at : NULL;
        part.range_m = rays->range_m + at;
        part.triangle = rays->triangle + at;
        part.label = rays->label != NULL ? rays->label + at : NULL;
        part.steep = rays->steep != NULL ? rays->steep + at : NULL;
        cast_chunk(work, &ray, &part);
    }
}

void bvh_hits_ordered(struct bvh_work *work, const struct bvh *bvh, const struct bvh_rays *rays, const uint8_t *order)
{
    struct decide_ray ray = ray_from(bvh, rays);
    bvh_hits(work, bvh, rays);
    if (bvh->ordered) return;
    for (uint32_t i = 0; i < rays->n; i++) {
        struct decide_hit hit = {rays->triangle[i], rays->range_m[i]};
        if (!order[i] || hit.prim == RTC_INVALID_GEOMETRY_ID) continue;
        set_ray(&ray, rays, i);
        decide_again(&ray, &hit);
        rays->triangle[i] = hit.prim;
        put(&ray, &hit, rays, i);
    }
    bvh_stage_ends(work->profile, BVH_STAGE_DECIDE);
}
