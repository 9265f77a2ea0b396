/* SPDX-License-Identifier: MIT */
/* Private to core/bvh: a packet meets a leaf. The rules are in bvh_inside.h. */
#ifndef CORE_BVH_MEET_H
#define CORE_BVH_MEET_H

#include <math.h>

#include "core/bvh/leaves.h"
#include "core/bvh/packet.h"
#include "core/embree.h"

/* Embree's callback. */
void bvh_meet_leaf(const struct RTCIntersectFunctionNArguments *args);

/* meet_wide.c: whether this processor and this build have leaves for packets of 16, which need AVX-512. */
int bvh_has_wide(void);
/* The same as bvh_meet_leaf, for a packet of 16. valid: -1 for rays that Embree asks for, else 0. */
void bvh_meet_wide(struct bvh_query *query, float *tfar, const struct bvh_leaf *leaf, const int *valid);

/* ---- meet_one.c: one ray and one triangle */

/* Decides in double whether the ray meets the triangle, and at what range. Packets call it where single precision
 * leaves doubt. Where the plane's range is of no use, the range lies between the edges that the ray passes. which: 0 or
 * 1, the triangle of the leaf. */
void bvh_try_one(struct bvh_query *query, float *tfar, uint32_t lane, const struct bvh_leaf *leaf, int which);
/* Notes a hit whose range is at most that of the nearest hit so far, or counts as equal. A hit in a texture's hole is
 * not noted. */
void bvh_note_hit(struct bvh_query *query, float *tfar, uint32_t lane, uint32_t triangle, double range_m);

/* A sine of the angle between ray and plane. At larger sines the range comes from the plane, at smaller ones from the
 * edges. A ray that is inside for certain in single precision has a larger sine: each of its sides is at least 8 units
 * of 2^-24 of F L (see below: 24 units of doubt, and errors of 16 at most). So the three sides, which add up to n . d,
 * are at least 1.4e-6 L L, and |n| is at most L L. */
#define BVH_FLAT 1e-6

/* ---- edges */

/* A leaf's edges, from one corner to another: three of triangle 0, then two of triangle 1. The third edge of triangle 1
 * is the second of triangle 0 in the other direction.
 *
 * The side of the edge from corner p to corner q, both relative to the ray's origin, is (p x (q - p)) . d. L is the
 * leaf's size: no edge is longer, and no corner is further from the leaf's base. F is the distance of that base from
 * the ray's origin, plus L. In single precision the side's error is at most 15 units of 2^-24 of F L: the base from the
 * ray's origin, rounded, 1; the corner, rounded and added to it, 2; the edge 3; the cross product 3; the direction 1;
 * the dot product 5. |p| itself is no measure, since it may be far smaller than its summands.
 *
 * Rays of a packet may begin at different points o. Then p and q are relative to c, the origin of one of them, and the
 * side is (p x (q - p)) . d + (q - p) . ((o - c) x d). The second term is at most A L, with A = |o - c|. So where the
 * first term's size is above the doubt by more than A L, its sign is that of the side. Once a ray of the packet is in
 * doubt at some leaf, the second term is computed, there and at all later leaves: for three edges, with A in place of F
 * in its error. For the other two edges it is a sum or difference of these three terms, since the edges of a triangle
 * add up to zero. The second term's error is therefore at most 2 * 15 + 1 units of A L. Adding it to the first term
 * rounds by 1 unit of A L and 1 of F L. So 48 units of A L are added to the doubt. The doubt of double precision
 * (edges.h) is far less than the rest of the bound. */
#define BVH_SIDE_DOUBT (24.0F * 0x1p-24F)
/* A L times this is added to the doubt of a ray from a point of its own: without the second term, and with it. The
 * 0.002 are for the rounding of A and of these products, and for directions that are no exact unit vectors. */
#define BVH_FIRST_DOUBT 1.002F
#define BVH_BOTH_DOUBT  (2.002F * BVH_SIDE_DOUBT)

/* The figures of a leaf by which rays are judged: edges e, and their moments m = p x (q - p). All rays from one point
 * share them. */
enum { BVH_EDGES = 5 };
struct bvh_edges {
    float m[3][8], e[3][8]; /* x, y, z of each edge; three more lanes to fill a vector */
    float doubt, size_m;    /* the doubt of rays from at_local; L */
} __attribute__((aligned(32)));

VEC_INLINE void bvh_find_edges(const struct bvh_query *query, const struct bvh_leaf *leaf, struct bvh_edges *edges)
{
    typedef float corners __attribute__((vector_size(16)));
    typedef float lanes __attribute__((vector_size(32)));
    const float size_m = bvh_leaf_size_m(bvh_leaf_rest(leaf));
    float base[3];
    lanes from[3], e[3];
    for (int j = 0; j < 3; j++) {
        corners v;
        memcpy(&v, leaf->corner_m[j], sizeof v);
        base[j] = (float)((double)leaf->base_m[j] - query->at_local[j]);
        const lanes start = __builtin_shufflevector(v, v, 0, 1, 2, 1, 3, 0, 0, 0);
        e[j] = __builtin_shufflevector(v, v, 1, 2, 0, 3, 2, 0, 0, 0) - start;
        from[j] = base[j] + start;
    }
    for (int j = 0; j < 3; j++) {
        const int k = (j + 1) % 3, l = (j + 2) % 3;
        const lanes m = from[k] * e[l] - from[l] * e[k];
        memcpy(edges->m[j], &m, sizeof m);
        memcpy(edges->e[j], &e[j], sizeof e[j]);
    }
    const float far_m = fabsf(base[0]) + fabsf(base[1]) + fabsf(base[2]) + size_m;
    edges->doubt = BVH_SIDE_DOUBT * 1.001F * far_m * size_m;
    edges->size_m = size_m;
}

#endif
