/* SPDX-License-Identifier: MIT */
#include "drivers/record/las_columns.h"

#include <math.h>

#include "core/vecmath.h"
#include "drivers/protocol/native.h"

#define SCAN_ANGLE_COUNTS_PER_RAD ((float)(1.0 / NATIVE_RAD_PER_DEG / 0.006))

/* ---- coordinates */

/* Rounds as rint does. Returns 0 where a number does not fit into 32 bits. vec_round is not exact from 2^51 on, but its
 * result is still far beyond 32 bits there. */
VEC_CLONES static int counts_fit(const double *restrict at, int n, double offset, double scale, int32_t *restrict to)
{
    uint64_t any_beyond = 0;
    for (int i = 0; i < n; i++) {
        uint64_t bits;
        const double counts = vec_round((at[i] - offset) / scale, &bits);
        any_beyond |= fabs(counts) <= INT32_MAX ? 0 : 1;
        to[i] = (int32_t)(uint32_t)bits;
    }
    return any_beyond == 0;
}

int las_set_counts(const double *at, int n, double offset, double scale, int32_t *to)
{
    int i = 0;
    if (counts_fit(at, n, offset, scale, to)) return n;
    while (i < n && fabs(rint((at[i] - offset) / scale)) <= INT32_MAX)
        i++;
    return i;
}

/* ---- intensities */

VEC_CLONES void las_set_intensities(const double *restrict reflectance_db, int n, uint16_t *restrict to)
{
    for (int i = 0; i < n; i++) {
        uint64_t bits;
        vec_round(reflectance_db[i] * 100, &bits);
        to[i] = (uint16_t)(isnan(reflectance_db[i]) ? 0 : bits + 32768);
    }
}

/* ---- scan angles */

enum { SCAN_ANGLE_NONE = UINT16_MAX };

/* The formula for one point, which gives SCAN_ANGLE_NONE where the angle is NaN. */
static uint16_t scan_angle(double x, double y, double z)
{
    const float flat = sqrtf((float)(x * x + y * y)), up = atan2f(flat, (float)-z);
    return isnan(up) ? SCAN_ANGLE_NONE : (uint16_t)lrintf(up * SCAN_ANGLE_COUNTS_PER_RAD);
}

/* atan of r within 0..1, to 2e-8 rad before rounding: Abramowitz and Stegun 4.4.49. */
VEC_INLINE float near_atan(float r)
{
    const float z = r * r;
    float s = 0.0028662257f;
    s = s * z - 0.0161657367f;
    s = s * z + 0.0429096138f;
    s = s * z - 0.0752896400f;
    s = s * z + 0.1065626393f;
    s = s * z - 0.1420889944f;
    s = s * z + 0.1999355085f;
    s = s * z - 0.3333314528f;
    return r + r * (z * s);
}

/* Computes scan angles as scan_angle does, to a hundredth of a count. The errors of the series and its rounding, of two
 * sums below pi and of atan2f are below 8e-7 rad together, or 0.008 counts. The error of either product is half a last
 * bit, or 0.001 counts. Angles within 0.015 counts of a half, or NaN, are set to SCAN_ANGLE_NONE: there the formula
 * decides. */
VEC_CLONES static void near_scan_angles(const double *restrict x, const double *restrict y, const double *restrict z,
                                        int n, uint16_t *restrict to)
{
    const float quarter = 1.57079632679f, half = 3.14159265359f, sure = 0.485f, magic = 12582912.0f; /* 1.5 * 2^23 */
    for (int i = 0; i < n; i++) {
        const float flat = sqrtf((float)(x[i] * x[i] + y[i] * y[i])), down = (float)-z[i], level = fabsf(down);
        const float least = flat < level ? flat : level, most = flat < level ? level : flat;
        const float angle = near_atan(least / most), from_axis = flat < level ? angle : quarter - angle;
        const float counts = (down < 0 ? half - from_axis : from_axis) * SCAN_ANGLE_COUNTS_PER_RAD;
        const float shifted = counts + magic, rest = counts - (shifted - magic);
        uint32_t bits;
        memcpy(&bits, &shifted, sizeof bits);
        to[i] = (uint16_t)(fabsf(rest) < sure ? bits : SCAN_ANGLE_NONE);
    }
}

uint64_t las_set_scan_angles(const double *x, const double *y, const double *z, int n, uint16_t *to)
{
    uint64_t n_none = 0;
    near_scan_angles(x, y, z, n, to);
    for (int i = 0; i < n; i++) {
        if (to[i] != SCAN_ANGLE_NONE) continue;
        to[i] = scan_angle(x[i], y[i], z[i]);
        if (to[i] != SCAN_ANGLE_NONE) continue;
        to[i] = 0;
        n_none++;
    }
    return n_none;
}
