/* SPDX-License-Identifier: MIT */
/* Private to core/bvh: leaves have the corners of their triangles in double, and Embree sees their boxes in float. */
#ifndef CORE_BVH_LEAVES_H
#define CORE_BVH_LEAVES_H

#include <string.h>

#include "core/bvh.h"
#include "core/embree.h"

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

/* Fills the leaves, and sets n_leaves. */
int bvh_make_leaves(struct bvh *bvh, const struct sh_report *report, struct sh_err *err);
/* Embree asks for the box of a leaf. */
void embree_asks_bounds(const struct RTCBoundsFunctionArguments *args);
/* The box around lo .. hi, from the BVH's origin, made larger for what Embree rounds. */
void bvh_pad_box(const struct bvh *bvh, const double lo_m[3], const double hi_m[3], double far_m,
                 struct RTCBounds *box);

#endif
