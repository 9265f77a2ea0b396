/* SPDX-License-Identifier: MIT */
/* Private to core/bvh: leaves that decide in double, and Embree, which finds the leaves.
 *
 * Meeting a triangle. A leaf has one or two triangles, with its corners in double. Seen from the origin o of a ray, a
 * corner A is p = A - o, rounded once. The ray with direction d passes an edge from p to q on the side that the sign
 * of (p x (q - p)) . d says, and meets a triangle where the sides of its edges, taken one way round, don't differ.
 * Where the sign is certain beyond the rounding of single or double precision, it is taken from there, by vectors
 * (meet.c). Else it is computed again, in one way for both triangles of the edge (edges.h), so that both get the
 * same number with opposite signs: no ray passes between them. A ray that meets nothing nearer, but passes the
 * edges of a triangle by less than their rounding, meets that triangle. So nothing passes at corners, either, nor
 * where a corner lies on another's edge up to rounding.
 *
 * How far. The range is that of the triangle's plane, in double (planes.c). The nearest of the triangles that a ray
 * meets is the hit. Hits within 1e-12 of its range count as equal: the one with the lowest number wins, in whatever
 * order they were tried. Where the order may have mattered, the ray is cast again from the nearest range on
 * (packet.c).
 *
 * Why no leaf is left out. Embree works in float. In units of 2^-24 its ray lies off the real one by at most 2 |o| +
 * |h| where it meets something at h, both counted from the BVH's origin: the rounding of the ray's origin, and of its
 * direction over the range, which is |o| + |h| at most. Embree's test of a box is the fast one for such geometry,
 * whatever the scene's flags say (3.13 and 4.4): with the reciprocal of a direction, its products and their difference
 * it errs by up to 7 units of the range. Together that is at most 9 |o| + 8 |h|. The boxes are larger than their
 * triangles by 8 (2 r + |h|), r being the radius of the scene. Where that is more than 9 R + 17 |h|, boxes are larger
 * by this, and float rays are at most R long: then |o| is at most |h| + R. A hit makes tfar the next float above its
 * range. At that range the real ray is at its triangle, so the float ray is in its box, and has entered it before. Rays
 * begin at most 1.5 r from the scene's middle: a ray from further away is moved along its direction until it is that
 * near (hits.c). So nothing here depends on where rays begin. Large triangles hardly enlarge the boxes of small ones
 * near the BVH's origin. In a large scene that origin is where most triangles are, else in the middle.
 *
 * Copies of a mesh. The mesh has a BVH of its own, in its own frame. Its copies are primitives of the scene's BVH, with
 * boxes made larger in the same way. A packet that reaches one is turned into the mesh's frame in double, and cast
 * there anew (copies.c). The rays and triangles there are those of the scene up to the rounding of that turn, so all of
 * the above holds in each copy. Ranges come back times the copy's scale.
 */
#ifndef CORE_BVH_BVH_INSIDE_H
#define CORE_BVH_BVH_INSIDE_H

#include <math.h>
#include <stddef.h>
#include <string.h>

#include "core/bvh.h"
#include "core/embree.h"

_Static_assert(sizeof(struct bvh_plane) == 4 * sizeof(double), "gathered as doubles"); /* planes.c */

/* Triangle 0 has the corners 0, 1, 2, and triangle 1 the corners 1, 3, 2. One that stands alone has corner 0 for 3. */
struct bvh_leaf {
    double corner_m[4][3]; /* prcs */
    uint32_t triangle;     /* 0 */
    /* Bit fields. 4 bits: how far triangle 1 follows triangle 0 in the scene's list, 0: there is none. Then two
     * lengths of 14 bits each. */
    uint32_t rest;
};
_Static_assert(sizeof(struct bvh_leaf) == 104, "there are half as many as triangles");
enum { BVH_LEAF_AHEAD = 16, BVH_LEAF_EDGE = 4, BVH_LEAF_FAR = 18 };

/* Lengths lack the sign and 17 bits of a float, and are rounded up by less than 1/64. */
enum { BVH_LENGTH_BITS = 17, BVH_LENGTH_MASK = 0x3fff };
static inline double bvh_leaf_length(const struct bvh_leaf *leaf, int at)
{
    const uint32_t bits = (leaf->rest >> at & BVH_LENGTH_MASK) << BVH_LENGTH_BITS;
    float f;
    memcpy(&f, &bits, sizeof f);
    return (double)f;
}
/* Upper bounds of its farthest corner's distance from the BVH's origin, and of its longest edge. */
static inline double bvh_leaf_far_m(const struct bvh_leaf *leaf)
{
    return bvh_leaf_length(leaf, BVH_LEAF_FAR);
}
static inline double bvh_leaf_edge_m(const struct bvh_leaf *leaf)
{
    return bvh_leaf_length(leaf, BVH_LEAF_EDGE);
}
static inline int bvh_leaf_has_two(const struct bvh_leaf *leaf)
{
    return leaf->rest % BVH_LEAF_AHEAD != 0;
}
/* which: 0, or 1 where there are two. */
static inline uint32_t bvh_leaf_triangle(const struct bvh_leaf *leaf, int which)
{
    return leaf->triangle + (which == 0 ? 0 : leaf->rest % BVH_LEAF_AHEAD);
}

/* A copy of a mesh: a primitive. */
struct bvh_copy {
    const struct scene_copy *at;
    const struct bvh *mesh;
    uint32_t first; /* its first triangle's number */
};

struct bvh {
    RTCDevice device;
    RTCScene rtc;
    const struct scene *scene;
    struct bvh_leaf *leaf;
    uint32_t n_leaves;
    struct bvh **mesh;       /* [scene->n_copied] of those that have copies */
    struct bvh_copy *copy;   /* [scene->n_copies] */
    struct bvh_plane *plane; /* one more than there are: the last stands for a miss, all NaN */
    double origin_m[3];      /* the middle of the scene, or where most of its triangles are (leaves.c) */
    double radius_m;         /* no vertex of the scene is further from there */
    double stretch_m;        /* float rays are no longer than this; INFINITY: they have any length */
    struct bvh_info info;
    int64_t bytes; /* as Embree reports */
};

/* A surface no further than this from a ray's origin is no hit: the ray begins on it, and goes on. This is
 * half of the wire's finest count, and far more than rounding makes of zero. */
#define BVH_AT_ORIGIN_M 5e-7
/* Ranges that differ by no more than this share of them are the same. */
#define BVH_SAME 1e-12

enum { BVH_PACKET = 16 };

#if RTC_VERSION_MAJOR >= 4
typedef struct RTCRayQueryContext bvh_context;
#else
typedef struct RTCIntersectContext bvh_context;
#endif

/* A packet in double, as leaves see it. Embree passes its context on, which is the first member. */
struct bvh_nested;
struct bvh_query {
    bvh_context context;
    const struct bvh *bvh;
    struct bvh_nested *nested; /* for copies; of a query within a copy: NULL */
    double at_origin_m;        /* no hit is nearer than this */
    uint32_t width;            /* rays of the call */
    int has_own;               /* each ray begins at its own point, org; else all begin at `at` */
    double at[3], at_local[3]; /* prcs; from the BVH's origin */
    double far_m;              /* no ray begins further from the BVH's origin */
    double most_m;             /* of a float ray, as in struct bvh_batch */
    double dir[3][BVH_PACKET]; /* of lanes without a ray: any */
    const float *dir_float;    /* [3][BVH_PACKET] the same for Embree; NULL: the packet is smaller */
    double org[3][BVH_PACKET], local[3][BVH_PACKET];
    double start_m[BVH_PACKET];    /* where the float ray begins, along the ray */
    double range_m[BVH_PACKET];    /* out: of the nearest so far; INFINITY: none */
    uint32_t triangle[BVH_PACKET]; /* out: the hit */
    double hit_m[BVH_PACKET];      /* out: its range */
    uint32_t unsure;               /* a bit for each ray that may have another hit of lower number */
    double near_m[BVH_PACKET];     /* of the nearest triangle that is missed by rounding alone; INFINITY: none */
    uint32_t near[BVH_PACKET];
    uint64_t decided, leaves; /* struct bvh_counters */
} __attribute__((aligned(64)));

/* A packet within a copy. */
struct bvh_nested {
    struct bvh_query query;
    struct RTCRayHit16 rays; /* or fewer */
    int valid[BVH_PACKET];
} __attribute__((aligned(64)));

/* A field of `width` rays, which has as many elements, from the names of struct RTCRayHit. Embree has accessors for C++
 * alone. */
#define bvh_field(rays, width, name) \
    ((float *)(void *)(rays) + offsetof(struct RTCRay, name) / sizeof(float) * (size_t)(width))
_Static_assert(offsetof(struct RTCRay16, tfar) == 16 * offsetof(struct RTCRay, tfar), "field by field");

/* R: longer than most heads see. */
#define BVH_STRETCH_M 8000.0

/* bvh.c: as bvh_create; in_one: rays have any length (copies.c). */
int bvh_create_whole(const struct scene *scene, int in_one, unsigned threads, const struct sh_report *report,
                     struct bvh **out, struct sh_err *err);
/* leaves.c: fills the leaves, and sets n_leaves; makes the planes. */
int bvh_make_leaves(struct bvh *bvh, const struct sh_report *report, struct sh_err *err);
int bvh_make_planes(struct bvh *bvh, const struct sh_report *report, struct sh_err *err);
void embree_asks_bounds(const struct RTCBoundsFunctionArguments *args);

/* meet.c: the callback. */
void bvh_meet_leaf(const struct RTCIntersectFunctionNArguments *args);

/* copies.c: BVHs of meshes that have copies; the boxes of the copies, and the callback. */
int bvh_make_copies(struct bvh *bvh, unsigned threads, const struct sh_report *report, struct sh_err *err);
void bvh_free_copies(struct bvh *bvh);
void embree_asks_copy_bounds(const struct RTCBoundsFunctionArguments *args);
void bvh_meet_copy(const struct RTCIntersectFunctionNArguments *args);
/* leaves.c: the box around lo .. hi, from the BVH's origin, made larger for what Embree rounds. */
void bvh_pad_box(const struct bvh *bvh, const double lo_m[3], const double hi_m[3], double far_m,
                 struct RTCBounds *box);

/* packet.c: Embree's context at its beginning; `width` rays through the BVH. */
void bvh_begin_query(struct bvh_query *query);
void bvh_call_embree(const struct bvh *bvh, struct bvh_query *query, const int *valid, void *rays, uint32_t width);

/* Forgets the near misses of the packet before. */
static inline void bvh_forget_near(struct bvh_query *query)
{
    for (uint32_t i = 0; i < BVH_PACKET; i++) {
        query->near_m[i] = INFINITY;
        query->near[i] = BVH_NO_TRIANGLE;
    }
}

/* packet.c: casts n <= BVH_CHUNK rays, whose float directions and origins are given. */
struct bvh_batch {
    const struct bvh_rays *rays;
    struct vec3_floats dir, org; /* org.x NULL: all at at_local */
    const double *start_m;       /* NULL: 0 */
    struct vec3_in local;        /* origins from the BVH's origin; x NULL: all at at_local */
    double at_local[3], far_m;
    float t_max;
    double most_m;                 /* of a float ray; INFINITY: what is further than t_max may or may not be met */
    struct bvh_counters *counters; /* counted up */
};
void bvh_intersect(const struct bvh *bvh, struct bvh_query *query, struct bvh_batch *batch);

/* planes.c */
/* Fills labels and steepness of all rays; those that hit nothing get the values of a miss. */
void bvh_refine(const struct bvh *bvh, const struct bvh_rays *rays);
/* copies.c: the same where there are copies. */
void bvh_refine_copies(const struct bvh *bvh, const struct bvh_rays *rays);
void bvh_cosines_copies(const struct bvh *bvh, const uint32_t *triangle, const struct vec3_in *dir, uint32_t n,
                        double *cosine);

#endif
