/* SPDX-License-Identifier: MIT */
/* Products of 3 by 3 matrices, row by row in nine doubles; out is never an input. */
#ifndef CORE_MAT3_H
#define CORE_MAT3_H

static const double mat3_unit[9] = {1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0};

static inline void mat3_multiply(const double a[9], const double b[9], double out[9])
{
    for (int i = 0; i < 9; i++)
        out[i] = a[i / 3 * 3] * b[i % 3] + a[i / 3 * 3 + 1] * b[3 + i % 3] + a[i / 3 * 3 + 2] * b[6 + i % 3];
}

static inline void mat3_transpose(const double a[9], double out[9])
{
    for (int i = 0; i < 9; i++)
        out[i] = a[i % 3 * 3 + i / 3];
}

static inline void mat3_apply(const double a[9], const double v[3], double out[3])
{
    for (int i = 0; i < 3; i++)
        out[i] = a[3 * i] * v[0] + a[3 * i + 1] * v[1] + a[3 * i + 2] * v[2];
}

/* Multiplies v by the transpose of a. The transpose of a rotation is its inverse. */
static inline void mat3_apply_transposed(const double a[9], const double v[3], double out[3])
{
    for (int i = 0; i < 3; i++)
        out[i] = a[i] * v[0] + a[3 + i] * v[1] + a[6 + i] * v[2];
}

#endif
