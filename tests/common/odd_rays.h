/* SPDX-License-Identifier: MIT */
/* Rays from a station that are hard to decide: at corners and edges, where outlines cross, within planes, along the
 * axes, and at the borders of the cells that a sight has (core/sight.h). There are also lines, as a scan has them. */
#ifndef TESTS_COMMON_ODD_RAYS_H
#define TESTS_COMMON_ODD_RAYS_H

#include <stdint.h>

#include "core/scene.h"

enum { ODD_RUN = 32 }; /* rays of one kind that follow each other */

struct odd_rays {
    const struct scene *scene;
    double station_m[3];
    uint32_t cells;  /* along an edge of the cube's faces */
    uint64_t random; /* not 0 */
};

enum odd_kind {
    ODD_LINE, /* evenly along a line */
    ODD_ANYWHERE,
    ODD_CORNERS,   /* of triangles, and a little beside them */
    ODD_EDGES,     /* points of edges, and of what lies a little beyond their ends */
    ODD_INSIDE,    /* anywhere in triangles */
    ODD_BORDERS,   /* within 4 units in the last place of a cell's border, or of two */
    ODD_BORDERED,  /* points of edges, moved onto the nearest border */
    ODD_CUBE,      /* edges and corners of the cube */
    ODD_AXES,      /* along an axis, or next to it: components of zero, of 1e-300, of 1e-9 */
    ODD_CROSSINGS, /* where two edges cross as seen */
    ODD_PLANES,    /* within a triangle's plane as far as double precision has it */
    ODD_MEETINGS,  /* where planes of two triangles meet */
    ODD_KINDS,
};

/* Writes n unit vectors of one kind; x, y and z are arrays of n. */
void odd_rays_fill(struct odd_rays *rays, enum odd_kind kind, uint32_t n, double *x, double *y, double *z);
/* Writes runs of all kinds. In the last quarter each ray is of another kind. */
void odd_rays_mix(struct odd_rays *rays, uint32_t n, double *x, double *y, double *z);

#endif
