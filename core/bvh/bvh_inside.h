/* SPDX-License-Identifier: MIT */
/* Private to core/bvh: what a BVH consists of. Embree finds the leaves. The leaves decide, in double where single
 * precision leaves doubt.
 *
 * Meeting a triangle. A leaf has one or two triangles. Seen from the origin o of a ray, a corner A is p = A - o. The
 * ray with direction d passes an edge from p to q on the side that the sign of (p x (q - p)) . d says, and meets a
 * triangle where the sides of its edges, taken one way round, don't differ. The sign is computed in single precision
 * first, with vector instructions (meet.c). Where rounding might have changed the sign, it is computed again in double
 * (edges.h), in one way for both triangles of the edge. Both triangles then get the same number with opposite signs, so
 * no ray passes between them. A ray that misses a triangle by less than the rounding at its edges meets that triangle,
 * unless it meets something nearer. So nothing passes at corners, either. The same holds where a corner of one triangle
 * lies on an edge of another one, to within rounding.
 *
 * How far. The range is that of the triangle's plane, in double (planes.c). The nearest of the triangles that a ray
 * meets is the hit. Hits within 1e-12 of its range count as equal: the one with the lowest number wins, in whatever
 * order they were tried. Where the order may have mattered, the ray is cast again, up to the nearest range (packet.c).
 *
 * Why no leaf is left out. Embree works in float. Errors are in units of 2^-24 here. o is the start of a ray and h its
 * hit, both counted from the BVH's origin. At h Embree's ray is at most 2 |o| + |h| away from the real ray. One |o| is
 * the rounding of the start. The rest is the rounding of the direction over the range, which is at most |o| + |h|.
 * The leaves are geometry of our own for Embree (RTC_GEOMETRY_TYPE_USER). Embree (3.13 and 4.4) tests the boxes of such
 * geometry by its fast test, whatever the scene's flags say. This test multiplies by the reciprocal of the direction,
 * and errs by up to 7 times the range. Together these errors are 9 |o| + 8 |h| at most. The boxes are larger than their
 * triangles by 8 (2 r + |h|), where r is the radius of the scene. In a large scene float rays are at most R =
 * BVH_STRETCH_M long, so |o| is at most |h| + R. Then 9 R + 17 |h| covers the errors, too, and the boxes are larger
 * than their triangles by the smaller one of the two lengths. A hit makes tfar the next float above its range. At that
 * range the real ray is at its triangle. So the float ray is in the triangle's box there, and has entered that box at a
 * shorter range. A ray from outside of the sphere of radius r about the BVH's origin starts further along its direction
 * (hits.c). If it can hit anything, its start is then at most 1.5 r from that origin. So nothing here depends on where
 * rays begin. Large triangles hardly enlarge the boxes of small ones near the BVH's origin. In a large scene without
 * copies that origin is where most triangles are, else in the middle.
 *
 * Copies of a mesh. The mesh has a BVH of its own, in its own frame. The copies are primitives of the scene's BVH, with
 * boxes made larger in the same way. A packet that reaches a copy is turned into the mesh's frame in double, and cast
 * there anew (copies.c). The rays and triangles there are those of the scene up to the rounding of that turn, so all of
 * the above holds in each copy. Ranges come back times the copy's scale. */
#ifndef CORE_BVH_BVH_INSIDE_H
#define CORE_BVH_BVH_INSIDE_H

#include "core/bvh.h"
#include "core/embree.h"

/* A copy of a mesh: a primitive. */
struct bvh_copy {
    const struct scene_copy *at;
    const struct bvh *mesh;
    uint32_t first; /* its first triangle's number */
};

struct bvh_leaf;

enum { BVH_LEAVES }; /* the leaves' geometry in Embree's scene, before that of copies */

struct bvh {
    RTCDevice device;
    RTCScene rtc;
    const struct scene *scene;
    struct bvh_leaf *leaf; /* [n_leaves + 1] */
    uint32_t n_leaves;
    struct bvh **mesh;     /* [scene->n_copied] of the meshes that have copies */
    struct bvh_copy *copy; /* [scene->n_copies] */
    /* [n_triangles + 1]: twice the number of the leaf that has a triangle's plane, plus 0 or 1: which of the leaf's two
     * planes it is. The last element stands for a miss: its plane is all NaN. */
    uint32_t *at_plane;
    double origin_m[3]; /* the middle of the scene, or where most of its triangles are (leaves.c) */
    double radius_m;    /* no vertex of the scene is further from there */
    double stretch_m;   /* float rays are no longer than this; INFINITY: they have any length */
    struct bvh_info info;
    int64_t bytes; /* as Embree reports */
};

/* R: longer than most heads see. */
#define BVH_STRETCH_M 8000.0

/* bvh.c: makes a BVH as bvh_create does. in_one 1: rays of any length are cast in one piece (copies.c). */
int bvh_create_whole(const struct scene *scene, int in_one, unsigned threads, const struct sh_report *report,
                     struct bvh **out, struct sh_err *err);

/* ---- planes.c: planes of triangles, in double; labels and steepness of rays */
void bvh_set_plane(const struct bvh *bvh, uint32_t triangle, struct bvh_plane *plane);
/* Notes where the leaves have the plane of each triangle: at_plane. */
int bvh_find_planes(struct bvh *bvh, const struct sh_report *report, struct sh_err *err);
/* Fills labels and steepness of all rays, each where its array is given. Rays that hit nothing get the values of a
 * miss. */
void bvh_refine(const struct bvh *bvh, const struct bvh_rays *rays);

/* ---- copies.c: copies of meshes, each of which has a BVH of its own */
/* Makes the BVHs of meshes that have copies. */
int bvh_make_copies(struct bvh *bvh, unsigned threads, const struct sh_report *report, struct sh_err *err);
void bvh_free_copies(struct bvh *bvh);
/* Embree calls these: for the box of a copy, and where a packet reaches a copy. */
void embree_asks_copy_bounds(const struct RTCBoundsFunctionArguments *args);
void bvh_meet_copy(const struct RTCIntersectFunctionNArguments *args);
/* Steepness and cosines where there are copies. */
void bvh_steepness_copies(const struct bvh *bvh, const struct bvh_rays *rays);
void bvh_cosines_copies(const struct bvh *bvh, const uint32_t *triangle, const struct vec3_in *dir, uint32_t n,
                        double *cosine);

#endif
