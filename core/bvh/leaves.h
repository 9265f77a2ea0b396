/* SPDX-License-Identifier: MIT */
/* Private to core/bvh: leaves have the corners of their triangles in single precision, and the planes in double. Embree
 * sees their boxes in float. */
#ifndef CORE_BVH_LEAVES_H
#define CORE_BVH_LEAVES_H

#include "core/bvh/bvh_inside.h"
#include "core/bytes.h"

/* Triangle 0 has the corners 0, 1, 2, and triangle 1 the corners 1, 3, 2. A leaf of one triangle has corner 0 in place
 * of corner 3.
 *
 * Waiting for leaves to arrive in the cache takes most of a ray's time. So each leaf is two cache lines that lie
 * together. The first has the corners in single precision, counted from a point near them. Where single precision is
 * certain, these corners decide whether a ray hits (meet.c). The second line has the planes in double, for rays that
 * hit. The scene has the corners in double. */
struct bvh_leaf {
    /* Corners count from this point, which counts from the BVH's origin. The lowest bits of the point's numbers hold
     * the leaf's size, and how far triangle 1 follows triangle 0 (bvh_leaf_size_m, bvh_leaf_ahead). These bits stay in
     * the numbers when corners are computed. */
    float base_m[3];
    float corner_m[3][4]; /* x, y, z of the corners, from base_m */
    uint32_t triangle;    /* number of triangle 0 */
    struct bvh_plane plane[2];
} __attribute__((aligned(128)));
_Static_assert(sizeof(struct bvh_leaf) == 128, "a leaf is two cache lines");

enum {
    BVH_LEAF_BITS = 6,       /* lowest bits of each number of base_m, which hold the two figures below */
    BVH_LEAF_AHEAD_BITS = 4, /* how far triangle 1 follows triangle 0 in the scene's list, 0: there is none */
    BVH_LEAF_AHEAD = 1 << BVH_LEAF_AHEAD_BITS,
    BVH_LENGTH_BITS = 17, /* a length is a float, rounded up, whose sign and this many lowest bits are left out */
};
static inline uint32_t bvh_leaf_rest(const struct bvh_leaf *leaf)
{
    const uint32_t mask = (1U << BVH_LEAF_BITS) - 1;
    return (float_bits(leaf->base_m[0]) & mask) | (float_bits(leaf->base_m[1]) & mask) << BVH_LEAF_BITS |
           (float_bits(leaf->base_m[2]) & mask) << 2 * BVH_LEAF_BITS;
}
/* Returns an upper bound of the edges' lengths, and of the corners' distances from base_m. */
static inline float bvh_leaf_size_m(uint32_t rest)
{
    return bits_float(rest >> BVH_LEAF_AHEAD_BITS << BVH_LENGTH_BITS);
}
static inline uint32_t bvh_leaf_ahead(uint32_t rest)
{
    return rest % BVH_LEAF_AHEAD;
}
static inline uint32_t bvh_leaf_triangle(const struct bvh_leaf *leaf, int which)
{
    return leaf->triangle + (which == 0 ? 0 : bvh_leaf_ahead(bvh_leaf_rest(leaf)));
}

/* Fills the leaves, and sets n_leaves. */
int bvh_make_leaves(struct bvh *bvh, const struct sh_report *report, struct sh_err *err);
/* Embree asks for the box of a leaf. */
void embree_asks_bounds(const struct RTCBoundsFunctionArguments *args);
/* Sets the box around lo .. hi, from the BVH's origin, made larger for what Embree rounds. far_m: how far the
 * farthest corner in the box is from the origin. */
void bvh_pad_box(const struct bvh *bvh, const double lo_m[3], const double hi_m[3], double far_m,
                 struct RTCBounds *box);

#endif
