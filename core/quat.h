/* SPDX-License-Identifier: MIT */
/* Unit quaternions w, x, y, z, as rotations. Angles in radians; pure. */
#ifndef CORE_QUAT_H
#define CORE_QUAT_H

#include <math.h>

/* out may be an input. */
static inline void quat_multiply(const double a[4], const double b[4], double out[4])
{
    const double w = a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3];
    const double x = a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2];
    const double y = a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1];
    const double z = a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0];
    out[0] = w;
    out[1] = x;
    out[2] = y;
    out[3] = z;
}

/* The matrix, row by row. */
static inline void quat_matrix(const double quat[4], double r[9])
{
    const double w = quat[0], x = quat[1], y = quat[2], z = quat[3];
    r[0] = 1.0 - 2.0 * (y * y + z * z);
    r[1] = 2.0 * (x * y - w * z);
    r[2] = 2.0 * (x * z + w * y);
    r[3] = 2.0 * (x * y + w * z);
    r[4] = 1.0 - 2.0 * (x * x + z * z);
    r[5] = 2.0 * (y * z - w * x);
    r[6] = 2.0 * (x * z - w * y);
    r[7] = 2.0 * (y * z + w * x);
    r[8] = 1.0 - 2.0 * (x * x + y * y);
}

/* The rotation from a to b in a's body frame: unit axis, and angle in [0, pi]. Axis x where they are the
 * same. */
static inline void quat_turn(const double a[4], const double b[4], double axis[3], double *angle_rad)
{
    const double inverse[4] = {a[0], -a[1], -a[2], -a[3]};
    double d[4];
    quat_multiply(inverse, b, d);
    const double sign = d[0] < 0.0 ? -1.0 : 1.0, sine = sqrt(d[1] * d[1] + d[2] * d[2] + d[3] * d[3]);
    *angle_rad = 2.0 * atan2(sine, sign * d[0]);
    for (int i = 0; i < 3; i++)
        axis[i] = sine > 0.0 ? sign * d[1 + i] / sine : i == 0 ? 1.0 : 0.0;
}

#endif
