/* SPDX-License-Identifier: MIT */
/* Private to core/bvh: on which side of a triangle's edges a ray passes, and how near, in double. Corners are relative
 * to the ray's origin. */
#ifndef CORE_BVH_EDGES_H
#define CORE_BVH_EDGES_H

#include <math.h>

#include "core/vec3.h"

static inline int before(const double a[3], const double b[3])
{
    for (int i = 0; i < 3; i++)
        if (a[i] != b[i]) return a[i] < b[i];
    return 0;
}

/* Returns on which side of the edge a-b the ray passes: the distance across the ray times the edge's length, with its
 * sign. The corners are taken in one order, whichever triangle asks. So the two triangles of an edge get the same
 * number with opposite signs. */
static inline double edge_side(const double a[3], const double b[3], const double dir[3])
{
    int swap = before(b, a);
    const double *p = swap ? b : a, *q = swap ? a : b;
    double e[3] = {q[0] - p[0], q[1] - p[1], q[2] - p[2]};
    double side = dir[0] * (p[1] * e[2] - p[2] * e[1]) + dir[1] * (p[2] * e[0] - p[0] * e[2]) +
                  dir[2] * (p[0] * e[1] - p[1] * e[0]);
    return swap ? -side : side;
}

/* Returns the range of the ray's point that is nearest to the segment. */
static inline double edge_range(const double a[3], const double b[3], const double dir[3])
{
    double e[3] = {b[0] - a[0], b[1] - a[1], b[2] - a[2]};
    double ee = vec3_dot(e, e), ed = vec3_dot(e, dir), ae = vec3_dot(a, e), ad = vec3_dot(a, dir),
           dd = vec3_dot(dir, dir);
    double det = ee * dd - ed * ed;
    double s = det > 0.0 ? (ed * ad - dd * ae) / det : 0.0;
    s = s < 0.0 ? 0.0 : s > 1.0 ? 1.0 : s;
    return (ad + s * ed) / dd;
}

/* Returns how far the ray's point at range t is from the segment. */
static inline double edge_gap(const double a[3], const double b[3], const double dir[3], double t)
{
    double e[3], w[3];
    for (int i = 0; i < 3; i++) {
        e[i] = b[i] - a[i];
        w[i] = t * dir[i] - a[i];
    }
    double s = vec3_dot(w, e) / vec3_dot(e, e);
    s = s < 0.0 ? 0.0 : s > 1.0 ? 1.0 : s;
    for (int i = 0; i < 3; i++)
        w[i] -= s * e[i];
    return sqrt(vec3_dot(w, w));
}

static inline int is_inside(const double side[3])
{
    return (side[0] >= 0.0 && side[1] >= 0.0 && side[2] >= 0.0) || (side[0] <= 0.0 && side[1] <= 0.0 && side[2] <= 0.0);
}

/* Returns a bound of the rounding error of edge_side. */
static inline double blur(const double a[3], const double b[3])
{
    return 8.0 * 0x1p-53 * sqrt(fmax(vec3_dot(a, a), vec3_dot(b, b))) * vec3_distance(a, b);
}

/* For a ray whose distance from the line of an edge is within rounding: whether it passes between the edge's ends, or
 * misses one of them by no more than rounding. The miss at an end is the end's distance from the ray. It is not
 * measured from the line's point that is nearest to the ray: where the ray goes almost along the edge, the error of
 * that point is far larger. */
static inline int is_beside(const double a[3], const double b[3], const double dir[3])
{
    double e[3], across[3];
    vec3_sub(b, a, e);
    const double ee = vec3_dot(e, e), ed = vec3_dot(e, dir), dd = vec3_dot(dir, dir);
    const double along = ed * vec3_dot(a, dir) - dd * vec3_dot(a, e); /* 0 at a; ee * dd - ed * ed at b */
    if (along >= 0.0 && along <= ee * dd - ed * ed) return 1;
    const double *end = along < 0.0 ? a : b;
    vec3_cross(end, dir, across);
    return vec3_dot(across, across) <= 0x1p-98 * vec3_dot(end, end); /* 16 units of 2^-53 of its distance */
}

/* Whether a ray misses a triangle by no more than rounding: beside an edge, not beyond its ends. */
static inline int is_near_miss(double v[3][3], const double side[3], const double dir[3])
{
    const double sign = side[0] + side[1] + side[2] < 0.0 ? -1.0 : 1.0; /* of n . dir */
    int touches = 0;
    for (int i = 0; i < 3; i++) {
        const double *a = v[i], *b = v[(i + 1) % 3], near = blur(a, b);
        if (-sign * side[i] > near) return 0;
        touches |= fabs(side[i]) <= near && is_beside(a, b, dir);
    }
    return touches;
}

/* Whether a ray lies in the triangle's plane, as far as double precision shows. Such a ray counts as no hit of this
 * triangle: it hits the neighbours at the edges. */
static inline int is_edge_on(double v[3][3], const double side[3])
{
    return fabs(side[0] + side[1] + side[2]) <= blur(v[0], v[1]) + blur(v[1], v[2]) + blur(v[2], v[0]);
}

#endif
