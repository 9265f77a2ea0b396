/* SPDX-License-Identifier: MIT */
/* The BVH: the exact first hits of rays in a scene, wherever the rays begin.
 *
 * In: a scene (vertices in double, prcs, metres), rays as points and unit directions in prcs. Out: for each
 * ray the range (m) of its first hit, the triangle, and its label.
 *
 * Embree finds leaves for float rays, in packets of the machine's native width. The leaves decide in double which ray
 * hits which triangle, and without any rounding where double is not enough. Ranges are those of the triangles' planes
 * in double. The proof is in core/bvh/bvh_inside.h.
 *
 * A BVH depends on the scene alone, is constant after it is made, and may be used from any thread; each thread has
 * working memory of its own. */
#ifndef CORE_BVH_H
#define CORE_BVH_H

#include <stdint.h>

#include "core/err.h"
#include "core/scene.h"
#include "core/vec3.h"

struct bvh;

struct bvh_info {
    uint32_t packet; /* rays per Embree call: 16, 8, 4 or 1 */
    double build_s;
    uint64_t bytes; /* BVH and planes */
};

/* The scene must outlive the BVH. Built with `threads` threads (0: all). SH_ESTOPPED where report asks to stop,
 * SH_ENOMEM where Embree or this module gets no memory, SH_EIO where Embree fails or does not support the processor,
 * SH_EINPUT where the scene has too many leaves. */
int bvh_create(const struct scene *scene, unsigned threads, const struct sh_report *report, struct bvh **out,
               struct sh_err *err);
void bvh_free(struct bvh *bvh);

/* Rays per Embree call: 1, 4, 8 or 16; for measuring and tests. Where this machine has no such packets, it is 1. The
 * hits are the same. */
void bvh_set_packet(struct bvh *bvh, uint32_t rays);
/* This machine's engine, in words: Embree's version, rays a packet, instructions. On machines with the same words, the
 * same rays hit the same triangles. SH_ENOMEM and SH_EIO as bvh_create has them; text is then empty. */
int bvh_engine(char *text, size_t len, struct sh_err *err);
const struct bvh_info *bvh_get_info(const struct bvh *bvh);
/* The origin of the local frame: the middle of the scene, or where most triangles of a large scene without copies
 * are. */
const double *bvh_origin(const struct bvh *bvh);
const struct scene *bvh_scene(const struct bvh *bvh);

/* The plane of a triangle in the local frame: its points p have n . p = d. n is e1 x e2: its length is
 * twice the area. */
struct bvh_plane {
    double n[3], d;
} __attribute__((aligned(32))); /* half a cache line */
/* The triangle must be one of the scene's own, not of a copy, and not BVH_NO_TRIANGLE. */
const struct bvh_plane *bvh_plane(const struct bvh *bvh, uint32_t triangle);
/* Gives the plane of any triangle, also of a copy. */
void bvh_get_plane(const struct bvh *bvh, uint32_t triangle, struct bvh_plane *plane);

enum {
    BVH_CHUNK = 1024, /* rays that are cast together */
    BVH_NO_TRIANGLE = 0xffffffff,
    BVH_NO_LABEL = 0xffff,
};

/* Where rays begin: all at one point (own.x NULL), or each at its own; prcs. */
struct bvh_origins {
    double at_m[3];
    struct vec3_in own;
};

static inline void bvh_origin_of(const struct bvh_origins *from, uint32_t i, double origin_m[3])
{
    for (int k = 0; k < 3; k++)
        origin_m[k] = from->own.x == NULL ? from->at_m[k]
                                          : (k == 0   ? from->own.x
                                             : k == 1 ? from->own.y
                                                      : from->own.z)[i];
}

struct bvh_rays {
    uint32_t n;
    struct bvh_origins from;
    struct vec3_in dir; /* unit vectors, prcs */
    double range_max_m; /* hits beyond it may or may not be reported */
    int scattered;      /* 1: neighbours go in different directions, and are cast one by one */
    /* out: */
    double *range_m;    /* along the ray; NaN: it meets nothing */
    uint32_t *triangle; /* of the scene; BVH_NO_TRIANGLE */
    uint32_t *label;    /* BVH_NO_LABEL; NULL: not asked for */
    float *steep;       /* 1 / cos^2 of the incidence, of rays from one point; NULL: not asked for */
};

/* The chunk of rays that begins with ray `at`: up to BVH_CHUNK of them. */
static inline struct bvh_rays bvh_rays_chunk(const struct bvh_rays *rays, uint32_t at)
{
    struct bvh_rays part = *rays;
    part.n = rays->n - at < BVH_CHUNK ? rays->n - at : BVH_CHUNK;
    part.dir = VEC3_IN(rays->dir, at);
    if (rays->from.own.x != NULL) part.from.own = VEC3_IN(rays->from.own, at);
    part.range_m = rays->range_m + at;
    part.triangle = rays->triangle + at;
    part.label = rays->label != NULL ? rays->label + at : NULL;
    part.steep = rays->steep != NULL ? rays->steep + at : NULL;
    return part;
}

struct bvh_counters {
    uint64_t leaves;  /* tests of a packet's rays against a leaf's triangles */
    uint64_t decided; /* pairs of ray and triangle so near an edge that each was examined by itself */
};

/* Cost by stage, for measuring: `now` counts in any unit and is read between the stages of each chunk. The
 * stages of the BVH are the first; more follow in core/cast.h. */
enum bvh_stage { BVH_STAGE_PREPARE, BVH_STAGE_EMBREE, BVH_STAGE_REFINE, BVH_STAGES };
struct bvh_profile {
    uint64_t (*now)(void);
    uint64_t last, spent[2 * BVH_STAGES];
};
/* The time since the end of the last stage counts as this stage's. */
static inline void bvh_stage_ends(struct bvh_profile *profile, int stage)
{
    if (profile == NULL) return;
    uint64_t now = profile->now();
    profile->spent[stage] += now - profile->last;
    profile->last = now;
}

/* Working memory of one thread. */
struct bvh_work;
int bvh_work_create(struct bvh_work **out, struct sh_err *err);
void bvh_work_free(struct bvh_work *work);
void bvh_work_set_profile(struct bvh_work *work, struct bvh_profile *profile); /* NULL: none */
const struct bvh_counters *bvh_work_counters(const struct bvh_work *work);
struct bvh_profile *bvh_work_profile(const struct bvh_work *work);
/* Directions of the last chunk, as Embree gets them. */
struct vec3_floats bvh_work_directions(const struct bvh_work *work);
/* Sets the directions of the last chunk, for n <= BVH_CHUNK rays that are decided without bvh_hits. */
void bvh_work_set_directions(struct bvh_work *work, const struct vec3_in *dir, uint32_t n);

/* Exact hits. Hits within half a micrometre of a ray's origin don't count, so that the ray does not hit the surface
 * that it begins on. tests/accuracy measures the error of ranges. Allocates nothing. */
void bvh_hits(struct bvh_work *work, const struct bvh *bvh, const struct bvh_rays *rays);

/* The range of one ray's first hit within 1e9 m; NaN: none. For single rays: it has working memory of its own, 70 kB on
 * the stack. */
double bvh_ray(const struct bvh *bvh, const double at_m[3], const double dir[3]);

/* ---- for rays from one point whose triangles are known from elsewhere (core/sight); not for scenes with
 * holes. */

/* All rays with the numbers `from` to `to` - 1 hit `triangle`, or nothing if it is BVH_NO_TRIANGLE. Sets their ranges,
 * labels and steepness, bit by bit as bvh_hits does. The function may overwrite up to seven rays after `to` - 1, so set
 * later rays afterwards. */
void bvh_ranges_of(const struct bvh *bvh, uint32_t triangle, const struct bvh_rays *rays, uint32_t from, uint32_t to);
/* The same where ray `from` hits triangle[0], the next one triangle[1], and so on. A ray stays as it
 * is where its entry of `triangle` is neither a triangle of the scene nor BVH_NO_TRIANGLE. */
void bvh_ranges_each(const struct bvh *bvh, const uint32_t *triangle, const struct bvh_rays *rays, uint32_t from,
                     uint32_t to);
/* The range of one plane along a ray, by the same arithmetic. */
double bvh_range_of(const struct bvh *bvh, uint32_t triangle, const double at_m[3], const double dir[3]);
/* Cosine of the incidence on the triangles that were hit, 0..1; NaN where there is none. */
void bvh_cosines(const struct bvh *bvh, const uint32_t *triangle, const struct vec3_in *dir, uint32_t n,
                 double *cosine);

/* Directions as Embree gets them. */
void bvh_to_float(const struct vec3_in *dir, uint32_t n, float *x, float *y, float *z);

#endif
