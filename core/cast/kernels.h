/* SPDX-License-Identifier: MIT */
/* Private to core/cast: the arithmetic around the cast, as loops over arrays that compilers turn into
 * vector code. */
#ifndef CORE_CAST_KERNELS_H
#define CORE_CAST_KERNELS_H

#include "core/cast.h"

/* Mirror and pan angle of n pulses of a run, from its pulse `first` on. */
void kernel_angles(const struct schedule_run *run, uint32_t first, uint32_t n, double *mirror_turn, double *pan_turn);
/* The same for a run with a table. */
void kernel_angles_table(const struct schedule_run *run, uint32_t first, uint32_t n, double *mirror_turn,
                         double *pan_turn);

/* Angles of the axes, in turns. */
struct kernel_turns {
    uint32_t n;
    const double *mirror, *pan;
};
/* Directions in prcs: rotation times (sin p cos m, cos p cos m, sin m). */
void kernel_directions(const struct kernel_turns *turns, const double rotation[9], const struct vec3_out *d);
/* The same, and also e: the directions as the encoders read them (whole counts), turned by to_crs instead
 * of rotation. */
void kernel_directions_read(const struct cast_setup *setup, const struct kernel_turns *turns, const double rotation[9],
                            const double to_crs[9], const struct vec3_out *d, const struct vec3_out *e);

/* ---- kernels_sweep.c: the same for a run whose axes turn evenly, for a fraction of the cost */
enum { KERNEL_BLOCK = 64 };
/* Sine, and cosine less 1, of -32 .. 31 steps. */
struct kernel_steps {
    int ready;
    double mirror_turn, pan_turn; /* a step */
    double sm[KERNEL_BLOCK], cm[KERNEL_BLOCK], sp[KERNEL_BLOCK], cp[KERNEL_BLOCK];
};
/* Computes the steps of a run, unless they are those of the run before. 0 where the run has a table, or its steps
 * are too large. */
int kernel_sweep_steps(struct kernel_steps *steps, const struct schedule_run *run);
/* Up to BVH_CHUNK pulses of a run, from its pulse `first` on. (Clang 19 crashes on a function with clones for several
 * instruction sets when a struct has the same name.) */
struct kernel_pulses {
    const struct schedule_run *run;
    uint32_t first;
    struct kernel_turns turns; /* from kernel_angles */
};
/* As kernel_directions, and kernel_directions_read. */
void kernel_sweep(const struct kernel_steps *steps, const struct kernel_pulses *sweep, const double rotation[9],
                  const struct vec3_out *d);
void kernel_sweep_read(const struct kernel_steps *steps, const struct kernel_pulses *sweep,
                       const struct cast_setup *setup, const double rotation[9], const double to_crs[9],
                       const struct vec3_out *d, const struct vec3_out *e);

/* ---- kernels_moving.c: pulses between two poses of a moving head */
struct kernel_leg {
    double before_ns, span_ns;         /* from the first pose to the run's t0; to the second pose */
    double position_m[3], shift_m[3];  /* at the first pose; from there to the second */
    double rotation[9], axis[3], turn; /* socs -> prcs at the first; about this axis of socs by `turn` turns */
};
void kernel_leg(const struct pose_knot *a, const struct pose_knot *b, int64_t t0_ns, struct kernel_leg *leg);
/* Directions s (socs) -> d (prcs) of n pulses, dt_ns after the run's t0. */
void kernel_turn_leg(const struct kernel_leg *leg, const uint32_t *dt_ns, uint32_t n, const struct vec3_in *s,
                     const struct vec3_out *d);
/* Their origins, prcs. */
void kernel_place_leg(const struct kernel_leg *leg, const uint32_t *dt_ns, uint32_t n, const struct vec3_out *p);
/* p + by. */
void kernel_shift(const struct vec3_in *p, const double by[3], uint32_t n, const struct vec3_out *o);
/* e * range + p - station. */
void kernel_scale_from(const double *range_m, const struct vec3_in *p, const double station_m[3], uint32_t n,
                       const struct vec3_out *e);
/* True when one of the rays may meet the sphere at v (from the rays' origin). */
int kernel_meets_sphere(const struct vec3_in *d, uint32_t n, const double v[3], double radius_m);
/* Directions turned by the inverse of a rotation. */
void kernel_turn_back(const struct vec3_in *d, const double rotation[9], uint32_t n, const struct vec3_out *e);

/* NaN for ranges outside of the head's limits. */
void kernel_limit(double *range_m, double min_m, double max_m, uint32_t n);
/* The keys of the echoes' random numbers: rng_echo. */
void kernel_keys(uint64_t pulse0, const uint8_t *number, uint32_t n, uint64_t *key);

/* Echo bytes and labels of pulses with one echo at most. Returns the number of echoes. */
uint32_t kernel_entries(const double *range_m, const uint32_t *label, uint32_t n, uint8_t *echo, uint16_t *out);
/* Widths of echoes in 0.01 ns, LINE_WIDTH_NONE for entries without echo. */
void kernel_widths(const float *width_m, const uint8_t *echo, uint32_t n, uint16_t *out);

/* The three numbers of entries on the wire. */
struct kernel_wire {
    uint32_t *a, *b, *c;
};
/* a: range in counts, 0 for none; b, c: encoder counts modulo a turn. */
void kernel_polar(const struct cast_setup *setup, const double *range_m, const struct kernel_turns *turns,
                  const struct kernel_wire *out);
/* Coordinates in counts of scale[], LINE_XYZ_NONE for NaN and for what doesn't fit. Returns how many
 * coordinates did not fit. */
uint32_t kernel_geo(const struct vec3_in *p, const double scale[3], uint32_t n, const struct kernel_wire *out);
/* The same for direction * range, where that is the position already. 0 where all fit. */
uint32_t kernel_place(const struct vec3_in *direction, const double *range_m, const double scale[3], uint32_t n,
                      const struct kernel_wire *out);
void kernel_scale(const double *range_m, uint32_t n, const struct vec3_out *e);

/* Firing times after the run's first pulse: j * quot + floor((acc + j * rem) / den). */
void kernel_times(const struct schedule_run *run, uint32_t *dt_ns);

#endif
