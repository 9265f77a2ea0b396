/* SPDX-License-Identifier: MIT */
/* Private to core/sight: the map of directions, and its lists of triangles, one of which a ray may hit.
 *
 * A direction d belongs to the face of the cube that its largest component points through: face
 * 2 * axis + (d[axis] < 0). On that face it has the coordinates u = d[axis + 1] / |d[axis]| and
 * v = d[axis + 2] / |d[axis]| (axes count modulo 3), both in -1..1. With the face's sign s,
 * d / |d[axis]| = s e_axis + u e_axis+1 + v e_axis+2: any function that is linear in d is linear in u and v,
 * and takes its extremes over a square at the corners.
 *
 * Two kinds of such functions matter for a triangle a, b, c (corners relative to the station). The side of
 * an edge, (a x (b - a)) . d, is positive inside; and plane . d = 1 / range. The doubt of such a function is a
 * bound of its rounding error, per unit length of d.
 *
 * A face has cells x cells squares, in tiles of SIGHT_TILE x SIGHT_TILE. A tile is one leaf, or a block of
 * leaves. A look-up may round a direction's coordinates: each leaf is valid for SIGHT_PAD beyond its own
 * borders.
 *
 * Why leaves are right. The hit of a ray, as core/bvh has it, depends on the triangles that the ray meets, or
 * misses by no more than the rounding of double, and on where it meets their planes. So it is enough to show
 * that all other triangles of the scene leave the hit as it is. A triangle is left out of a square only in
 * one of three ways:
 * - Beside the square (bins.c, region.c): the side of one edge is below minus its doubt at the four corners of the
 *   square, pad included. The side is linear, so it is below that everywhere in the square: all rays miss the triangle,
 *   by more than core/bvh takes for a near miss. Regions hold every triangle whose corners are not all beyond one side
 *   of the region's pyramid, which is wider than the region by some pads.
 * - Behind (region.c): another one covers the square (all sides above their doubts at all corners, so every ray
 *   passes inside), and its plane . d is larger at all corners by more than the doubts of both. So every ray comes to
 *   the covering triangle first, in whatever way the ray's ranges are rounded. An edge that is nearly hit lies in its
 *   triangle's plane, so it comes later as well.
 * - Behind as a whole: where plane . d says nothing, since the plane is seen at a sine below SIGHT_GRAZE somewhere in
 *   the square, the triangle's nearest point is further away than all of the triangle that covers the square.
 * Groups of small triangles (groups.c) are left out in two of these ways. Beside a square: the square lies outside of
 * the box that holds the group, with the margin of regions. Behind as a whole: by the box's nearest point. Where a
 * group is not left out of a square, the square asks core/bvh. The leaf holds the triangles that are left: one that
 * covers the square (SIGHT_ONE), none (SIGHT_NOTHING), or a few. A few are decided ray by ray with the same doubts
 * (candidate_list.c). Where a doubt remains, core/bvh decides. Planes seen at a sine below SIGHT_GRAZE neither cover
 * nor hide. Over a square each doubt counts twice, since there d has a largest component of 1 and is up to sqrt(3)
 * long. */
#ifndef CORE_SIGHT_SIGHT_INSIDE_H
#define CORE_SIGHT_SIGHT_INSIDE_H

#include <stdatomic.h>

#include "core/sight.h"

enum {
    SIGHT_FACES = 6,
    SIGHT_TILE = 8, /* cells along the edge of a tile */
    SIGHT_BLOCK = SIGHT_TILE * SIGHT_TILE,
    SIGHT_MIN_CELLS = 64,
    SIGHT_MAX_CELLS = 2048, /* a cell is then a thousand times its pad */
    SIGHT_MAX_LIST = 32,
};
/* In the coordinates on a face: more than twice the error of a look-up in single precision (places.c). */
#define SIGHT_PAD 0x1p-20

/* A leaf, or what a tile says: the kind in the two highest bits, a number in the others. */
enum sight_kind {
    SIGHT_ONE,   /* the number is that of a triangle: all rays meet it first */
    SIGHT_FEW,   /* list[number] is how many records follow, list[number + 1] .. which ones */
    SIGHT_TILED, /* of a tile: leaf[number] .. leaf[number + SIGHT_BLOCK - 1] are its leaves, rows of u */
    SIGHT_OTHER,
};
enum { SIGHT_KIND_SHIFT = 30, SIGHT_NUMBER = (1U << SIGHT_KIND_SHIFT) - 1 };
static const uint32_t SIGHT_NOTHING = 0xffffffff, SIGHT_ASK = 0xfffffffe, SIGHT_NO_LEAF = 0xfffffffd;

static inline enum sight_kind sight_kind(uint32_t leaf)
{
    return (enum sight_kind)(leaf >> SIGHT_KIND_SHIFT);
}

/* A triangle of a list, in the form that decides whether a ray hits it. d is the ray's unit vector, and q = plane . d:
 * - inside for certain: all of edge[k] . d >= 1. Outside for certain: one is <= -1. (Edges are divided by
 *   what double precision leaves in doubt, here and in core/bvh together.)
 * - certainly not hit, or not to be decided here: q < graze, or q > SIGHT_NEAR.
 * - of two triangles the one with the larger q comes first for certain where the q differ by more than
 *   slack + slack' + SIGHT_SAME q. */
struct sight_record {
    double edge[3][3];
    double plane[3];
    double slack; /* doubt of q */
    double graze;
    uint32_t triangle;
} __attribute__((aligned(128)));

/* The doubt of an edge's side, relative to the distance of its farther end times its length. The doubt is 10 units
 * of 2^-53 here: the difference of the corners 1, the cross product 6, the product with a direction 3. core/bvh
 * adds as many. core/bvh also takes a ray for a near miss up to 8 units beyond an edge. */
#define SIGHT_EDGE_DOUBT (32.0 * 0x1p-53)
/* The doubt of a . (b x c), relative to the product of their lengths, here and in core/bvh together. */
#define SIGHT_VOLUME_DOUBT (32.0 * 0x1p-53)
/* A bound of the distance between a triangle and its plane in core/bvh, relative to its longest edge: far more than
 * rounding. */
#define SIGHT_TILT_DOUBT 0x1p-38
/* The doubt of plane . d, relative to the plane's length: its components 1, the product 3; twice, here and
 * in core/bvh. */
#define SIGHT_PLANE_DOUBT (16.0 * 0x1p-53)
/* Planes seen at a smaller sine are not decided here. Below 1e-6 core/bvh limits ranges to those between
 * the edges. */
#define SIGHT_GRAZE 0x1p-15
/* core/bvh takes ranges within 1e-12 of each other for the same: the lowest triangle wins. Ranges that
 * differ by more than this are certainly different. */
#define SIGHT_SAME 4e-12
/* 1 / m. For core/bvh a ray begins on a surface nearer than BVH_AT_ORIGIN_M, and does not hit it. Surfaces nearer than
 * twice that distance are left to core/bvh. */
#define SIGHT_NEAR 1e6

struct sight {
    _Atomic uint32_t owners;
    const struct bvh *bvh;
    double station_m[3];
    uint32_t cells; /* power of two */
    /* [SIGHT_FACES][cells / SIGHT_TILE][cells / SIGHT_TILE], v outside, u inside; one more that says SIGHT_ASK */
    uint32_t *tile;
    uint32_t *leaf; /* blocks */
    uint32_t *list;
    struct sight_record *record;
    struct sight_info info;
};

#endif
