/* SPDX-License-Identifier: MIT */
/* Vectors of three doubles: sums and products of two of them, bounds, and arrays of them as kernels take them, an
 * array for each component. */
#ifndef CORE_VEC3_H
#define CORE_VEC3_H

#include <math.h>

static inline double vec3_dot(const double a[3], const double b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static inline void vec3_cross(const double a[3], const double b[3], double out[3])
{
    out[0] = a[1] * b[2] - a[2] * b[1];
    out[1] = a[2] * b[0] - a[0] * b[2];
    out[2] = a[0] * b[1] - a[1] * b[0];
}

static inline void vec3_sub(const double a[3], const double b[3], double out[3])
{
    for (int i = 0; i < 3; i++)
        out[i] = a[i] - b[i];
}

static inline void vec3_add(const double a[3], const double b[3], double out[3])
{
    for (int i = 0; i < 3; i++)
        out[i] = a[i] + b[i];
}

/* Twice the area of the triangle a, b, c, along its normal. */
static inline void vec3_normal(const double a[3], const double b[3], const double c[3], double out[3])
{
    double u[3], v[3];
    vec3_sub(b, a, u);
    vec3_sub(c, a, v);
    vec3_cross(u, v, out);
}

static inline double vec3_length(const double a[3])
{
    return sqrt(vec3_dot(a, a));
}

static inline double vec3_distance(const double a[3], const double b[3])
{
    double d[3];
    vec3_sub(a, b, d);
    return vec3_length(d);
}

/* Bounds of points: vec3_bound_nothing begins with empty ones, vec3_bound widens them by a point. NaN widens none. */
static inline void vec3_bound_nothing(double min[3], double max[3])
{
    for (int i = 0; i < 3; i++) {
        min[i] = INFINITY;
        max[i] = -INFINITY;
    }
}

static inline void vec3_bound(double min[3], double max[3], const double a[3])
{
    for (int i = 0; i < 3; i++) {
        if (a[i] < min[i]) min[i] = a[i];
        if (a[i] > max[i]) max[i] = a[i];
    }
}

/* Whether one of a triangle's corners is the origin. A ray that begins at a corner hits the triangle nowhere else. For
 * any direction the ray touches the lines of two edges: their side tests give 0, and the plane's range is only
 * rounding. */
static inline int vec3_is_any_zero(double corner[3][3])
{
    for (int i = 0; i < 3; i++)
        if (corner[i][0] == 0.0 && corner[i][1] == 0.0 && corner[i][2] == 0.0) return 1;
    return 0;
}

/* Vectors as arrays, one per axis; the arrays stay the caller's. */
struct vec3_in {
    const double *x, *y, *z;
};
struct vec3_out {
    double *x, *y, *z;
};
struct vec3_floats {
    const float *x, *y, *z;
};

/* The arrays x, y and z of anything, from element i on. */
#define VEC3_IN(a, i)  ((struct vec3_in){(a).x + (i), (a).y + (i), (a).z + (i)})
#define VEC3_OUT(a, i) ((struct vec3_out){(a).x + (i), (a).y + (i), (a).z + (i)})

/* Element i as a vector. */
#define VEC3_AT(a, i)                \
    {                                \
        (a).x[i], (a).y[i], (a).z[i] \
    }
#define VEC3_SET(a, i, v) ((a).x[i] = (v)[0], (a).y[i] = (v)[1], (a).z[i] = (v)[2])

#endif
