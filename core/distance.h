/* SPDX-License-Identifier: MIT */
/* The exact distance of a point to the scene's own triangles. Triangles of copies don't count; core/scene_copies.h
 * turns copies into own triangles. In: a scene, and a point in prcs (metres). Out: the nearest point of the mesh.
 * Embree's point query proposes triangles, double precision decides.
 *
 * The query runs in a float frame about the scene's centre. Every radius is widened by that frame's rounding,
 * so no triangle that could be nearest is missed. The distance from point to triangle is computed in double, edges and
 * face separately, since barycentric regions (Ericson, Real-Time Collision Detection, 5.1.5) lose digits on needles.
 * Its error is at most 16 half-units in the last place of the distance to the triangle's farthest corner, at
 * any coordinates. */
#ifndef CORE_DISTANCE_H
#define CORE_DISTANCE_H

#include "core/scene.h"

struct distance;

struct distance_hit {
    double distance_m;
    double point_m[3]; /* the nearest point of the mesh, prcs */
    uint32_t triangle;
};

/* The scene must outlive the index. */
int distance_create(const struct scene *scene, struct distance **out, struct sh_err *err);
void distance_free(struct distance *index);

/* Nearest point of the mesh within max_m. Returns 1 and fills hit, or 0 when nothing is that near. Points farther than
 * 1e18 m from the scene's centre along an axis have nothing near, whatever max_m is.
 * Thread: any number at once. */
int distance_query(const struct distance *index, const double p_prcs[3], double max_m, struct distance_hit *hit);

#endif
