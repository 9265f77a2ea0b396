/* SPDX-License-Identifier: MIT */
/* Private to core/cast/kernels_*.c: shared parts of their loops over directions. */
#ifndef CORE_CAST_AIM_INLINE_H
#define CORE_CAST_AIM_INLINE_H

#include "core/cast/kernels_aim.h"
#include "core/vecmath.h"

/* A matrix in local values, so that the compiler need not read it again after each store to an array. */
struct aim_matrix {
    double xx, xy, xz, yx, yy, yz, zx, zy, zz;
};
VEC_INLINE struct aim_matrix aim_matrix(const double m[9])
{
    return (struct aim_matrix){m[0], m[1], m[2], m[3], m[4], m[5], m[6], m[7], m[8]};
}

/* Sines and cosines of the angles of mirror and pan. */
struct aim_axes {
    double sm, cm, sp, cp;
};

/* Sets d to m times (sin p cos m, cos p cos m, sin m). */
VEC_INLINE void aim_direction(struct aim_matrix m, struct aim_axes a, struct vec3_out d, uint32_t i)
{
    const double x = a.sp * a.cm, y = a.cp * a.cm;
    d.x[i] = m.xx * x + m.xy * y + m.xz * a.sm;
    d.y[i] = m.yx * x + m.yy * y + m.yz * a.sm;
    d.z[i] = m.zx * x + m.zy * y + m.zz * a.sm;
}

/* An encoder: counts per turn, and a count in radians. count_rad is 0 where both encoders of a head are ideal. */
struct aim_encoder {
    double counts, count_rad;
};
/* The encoders of a head, and the matrix to the frame of positions. */
struct aim_reading {
    struct aim_encoder mirror, pan;
    struct aim_matrix m;
};
VEC_INLINE struct aim_reading aim_reading(const struct kernel_reading *reading)
{
    const double mirror = reading->setup->mirror_counts, pan = reading->setup->pan_counts;
    const int ideal = mirror >= 4294967296.0 && pan >= 4294967296.0;
    return (struct aim_reading){{mirror, ideal ? 0.0 : VEC_TURN_RAD / mirror},
                                {pan, ideal ? 0.0 : VEC_TURN_RAD / pan},
                                aim_matrix(reading->rotation)};
}

/* Sine and cosine of an angle become those of what the encoder reads, whole counts. The encoder's error d is at most
 * half a count: sin(a + d) = sin a + d cos a - d^2/2 sin a leaves d^3/6, which is 1e-12 for 2^14 counts per turn,
 * 5e-18 for 2^20. */
VEC_INLINE void aim_read(struct aim_encoder e, double turn, double *sine, double *cosine)
{
    uint64_t bits;
    const double counts = turn * e.counts, d = (vec_round(counts, &bits) - counts) * e.count_rad;
    const double h = 1.0 - 0.5 * d * d, s = *sine, c = *cosine;
    *sine = s * h + c * d;
    *cosine = c * h - s * d;
}

/* Sets e to the direction that the encoders read at these angles, whose sines and cosines are a. */
VEC_INLINE void aim_direction_read(struct aim_reading r, double mirror_turn, double pan_turn, struct aim_axes a,
                                   struct vec3_out e, uint32_t i)
{
    aim_read(r.mirror, mirror_turn, &a.sm, &a.cm);
    aim_read(r.pan, pan_turn, &a.sp, &a.cp);
    aim_direction(r.m, a, e, i);
}

#endif
