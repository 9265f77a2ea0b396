/* SPDX-License-Identifier: MIT */
/* The loops that evaluate polynomials are a macro, since they are compiled more than once. polynomial_apply.c makes
 * clones for several CPUs. tests/bench/chart_widths.c makes one version for each width of vectors. */
#ifndef CORE_GEOREF_POLYNOMIAL_KERNELS_H
#define CORE_GEOREF_POLYNOMIAL_KERNELS_H

#include <math.h>
#include <string.h>

#include "core/angle.h"
#include "core/georef/polynomial.h"
#include "core/vecmath.h"

enum { POLYNOMIAL_BLOCK = 128 }; /* most points that a kernel takes at a time */

/* out is none of the inputs. The restrict pointers are parameters, since compilers ignore restrict on
 * members of a struct. */
typedef void polynomial_space(const double c[POLYNOMIAL_USED], size_t n, struct vec3_in d, double *restrict out);
typedef void polynomial_flat(const double c[POLYNOMIAL_PLANE], size_t n, struct vec3_in d, double *restrict out);
typedef void polynomial_meridian(const struct polynomial *p, size_t n, struct vec3_in d,
                                 double (*restrict out)[POLYNOMIAL_BLOCK]);

/* By order; NULL where there is none. */
struct polynomial_kernels {
    polynomial_space *space[6];
    polynomial_flat *flat[6];
    polynomial_meridian *meridian[6];
};

/* Does what polynomial_apply does, with the given kernels. */
void polynomial_apply_with(const struct polynomial_kernels *kernels, const struct polynomial *p, int order, size_t n,
                           struct vec3_in d, struct vec3_out out);

VEC_INLINE double space1(const double *c, double x, double y, double z)
{
    return x * c[0] + y * c[1] + z * c[2];
}

VEC_INLINE double space2(const double *c, double x, double y, double z)
{
    return x * (c[0] + x * c[3] + y * c[4] + z * c[5]) + y * (c[1] + y * c[6] + z * c[7]) + z * (c[2] + z * c[8]);
}

VEC_INLINE double space3(const double *c, double x, double y, double z)
{
    double in_x = c[0] + x * (c[3] + x * c[9] + y * c[10] + z * c[11]) + y * (c[4] + y * c[12] + z * c[13]) +
                  z * (c[5] + z * c[14]);
    double in_y = c[1] + y * (c[6] + y * c[15] + z * c[16]) + z * (c[7] + z * c[17]);
    return x * in_x + y * in_y + z * (c[2] + z * (c[8] + z * c[18]));
}

VEC_INLINE double plane1(const double *c, double p, double q)
{
    return p * c[0] + q * c[1];
}

VEC_INLINE double plane2(const double *c, double p, double q)
{
    return p * (c[0] + p * c[2] + q * c[3]) + q * (c[1] + q * c[4]);
}

VEC_INLINE double plane3(const double *c, double p, double q)
{
    return p * (c[0] + p * (c[2] + p * c[5] + q * c[6]) + q * (c[3] + q * c[7])) + q * (c[1] + q * (c[4] + q * c[8]));
}

VEC_INLINE double plane5(const double *c, double p, double q)
{
    double q4 = c[13] + p * c[18] + q * c[19];
    double q3 = c[8] + p * (c[12] + p * c[17]);
    double q2 = c[4] + p * (c[7] + p * (c[11] + p * c[16]));
    double q1 = c[1] + p * (c[3] + p * (c[6] + p * (c[10] + p * c[15])));
    double q0 = p * (c[0] + p * (c[2] + p * (c[5] + p * (c[9] + p * c[14]))));
    return q0 + q * (q1 + q * (q2 + q * (q3 + q * q4)));
}

/* Returns 2 atan t in degrees. The terms of the series from t^9 on are left out. Together they are at most
 * POLYNOMIAL_ATAN_LEFT t^9, in radians. */
#define POLYNOMIAL_ATAN_LEFT (2.0 / 9.0)
VEC_INLINE double twice_atan_deg(double t)
{
    const double deg = angle_deg(1.0);
    double q = t * t;
    return t * (2.0 * deg + q * (-2.0 / 3.0 * deg + q * (2.0 / 5.0 * deg + q * (-2.0 / 7.0 * deg))));
}

/* One output at a time: its coefficients stay in registers. */
#define POLYNOMIAL_SPACE_KERNEL(ATTRIBUTE, name, order)                                                    \
    ATTRIBUTE static void name##_space##order(const double c[POLYNOMIAL_USED], size_t n, struct vec3_in d, \
                                              double *restrict out)                                        \
    {                                                                                                      \
        const double *restrict x = d.x, *restrict y = d.y, *restrict z = d.z;                              \
        double k[POLYNOMIAL_USED];                                                                         \
        memcpy(k, c, sizeof k);                                                                            \
        for (size_t i = 0; i < n; i++)                                                                     \
            out[i] = space##order(k, x[i], y[i], z[i]);                                                    \
    }
#define POLYNOMIAL_FLAT_KERNEL(ATTRIBUTE, name, order)                                                     \
    ATTRIBUTE static void name##_flat##order(const double c[POLYNOMIAL_PLANE], size_t n, struct vec3_in d, \
                                             double *restrict out)                                         \
    {                                                                                                      \
        const double *restrict x = d.x, *restrict y = d.y;                                                 \
        double k[POLYNOMIAL_PLANE];                                                                        \
        memcpy(k, c, sizeof k);                                                                            \
        for (size_t i = 0; i < n; i++)                                                                     \
            out[i] = plane##order(k, x[i], y[i]);                                                          \
    }
#define POLYNOMIAL_MERIDIAN_KERNEL(ATTRIBUTE, name, order)                                                        \
    ATTRIBUTE static void name##_meridian##order(const struct polynomial *p, size_t n, struct vec3_in d,          \
                                                 double(*restrict out)[POLYNOMIAL_BLOCK])                         \
    {                                                                                                             \
        const double *restrict x = d.x, *restrict y = d.y, *restrict z = d.z;                                     \
        double lat[POLYNOMIAL_PLANE], up[POLYNOMIAL_PLANE], t[9];                                                 \
        const double axis = p->meridian.axis_m, sine = p->meridian.sin_lat, cosine = p->meridian.cos_lat;         \
        memcpy(lat, p->plane[0], sizeof lat);                                                                     \
        memcpy(up, p->plane[1], sizeof up);                                                                       \
        memcpy(t, p->meridian.turn, sizeof t);                                                                    \
        for (size_t i = 0; i < n; i++) {                                                                          \
            double e = t[0] * x[i] + t[1] * y[i] + t[2] * z[i], north = t[3] * x[i] + t[4] * y[i] + t[5] * z[i];  \
            double u = t[6] * x[i] + t[7] * y[i] + t[8] * z[i], a = axis + (cosine * u - sine * north);           \
            double half = e / (sqrt(a * a + e * e) + a), moved = e * half; /* tangent of half the angle; s - a */ \
            north -= sine * moved;                                                                                \
            u += cosine * moved;                                                                                  \
            out[0][i] = plane##order(lat, north, u);                                                              \
            out[1][i] = twice_atan_deg(half);                                                                     \
            out[2][i] = plane##order(up, north, u);                                                               \
        }                                                                                                         \
    }
#define POLYNOMIAL_KERNELS(ATTRIBUTE, name)                                           \
    POLYNOMIAL_SPACE_KERNEL(ATTRIBUTE, name, 1)                                       \
    POLYNOMIAL_SPACE_KERNEL(ATTRIBUTE, name, 2)                                       \
    POLYNOMIAL_SPACE_KERNEL(ATTRIBUTE, name, 3)                                       \
    POLYNOMIAL_FLAT_KERNEL(ATTRIBUTE, name, 1)                                        \
    POLYNOMIAL_FLAT_KERNEL(ATTRIBUTE, name, 2)                                        \
    POLYNOMIAL_FLAT_KERNEL(ATTRIBUTE, name, 3)                                        \
    POLYNOMIAL_FLAT_KERNEL(ATTRIBUTE, name, 5)                                        \
    POLYNOMIAL_MERIDIAN_KERNEL(ATTRIBUTE, name, 1)                                    \
    POLYNOMIAL_MERIDIAN_KERNEL(ATTRIBUTE, name, 2)                                    \
    POLYNOMIAL_MERIDIAN_KERNEL(ATTRIBUTE, name, 3)                                    \
    static const struct polynomial_kernels name = {                                   \
        .space = {NULL, name##_space1, name##_space2, name##_space3, NULL, NULL},     \
        .flat = {NULL, name##_flat1, name##_flat2, name##_flat3, NULL, name##_flat5}, \
        .meridian = {NULL, name##_meridian1, name##_meridian2, name##_meridian3, NULL, NULL}};

#endif
