/* SPDX-License-Identifier: MIT */
/* Private to core/cast: these loops over arrays turn and shift vectors, of a head or a body that moves. */
#ifndef CORE_CAST_KERNELS_MOVING_H
#define CORE_CAST_KERNELS_MOVING_H

#include "core/pose.h"
#include "core/vec3.h"

/* The way between two poses of a moving head. */
struct kernel_leg {
    double before_ns, span_ns;         /* from the first pose to the run's t0; to the second pose */
    double position_m[3], shift_m[3];  /* at the first pose; from there to the second */
    double rotation[9], axis[3], turn; /* socs -> prcs at the first; it turns about `axis` (socs) by `turn` turns */
};
void kernel_leg(const struct pose_knot *a, const struct pose_knot *b, int64_t t0_ns, struct kernel_leg *leg);
/* Turns directions s (socs) to d (prcs), of n pulses, dt_ns after the run's t0. */
void kernel_turn_leg(const struct kernel_leg *leg, const uint32_t *dt_ns, uint32_t n, const struct vec3_in *s,
                     const struct vec3_out *d);
/* Computes the origins (prcs) of n pulses, dt_ns after the run's t0. */
void kernel_place_leg(const struct kernel_leg *leg, const uint32_t *dt_ns, uint32_t n, const struct vec3_out *p);
/* o = p + by. */
void kernel_shift(const struct vec3_in *p, const double by[3], uint32_t n, const struct vec3_out *o);
/* e becomes e * range + p - station. */
void kernel_scale_from(const double *range_m, const struct vec3_in *p, const double station_m[3], uint32_t n,
                       const struct vec3_out *e);
/* Returns 1 where one of the rays may hit the sphere at v (from the rays' origin). */
int kernel_meets_sphere(const struct vec3_in *d, uint32_t n, const double v[3], double radius_m);
/* Turns directions by the inverse of a rotation. */
void kernel_turn_back(const struct vec3_in *d, const double rotation[9], uint32_t n, const struct vec3_out *e);

#endif
