/* SPDX-License-Identifier: MIT */
/* Private to core/cast: these loops over arrays find where the pulses of a run go. Compilers turn them into vector
 * code, but for the loop of a run with a table. */
#ifndef CORE_CAST_KERNELS_AIM_H
#define CORE_CAST_KERNELS_AIM_H

#include "core/cast.h"

/* Computes mirror and pan angle of n pulses of a run, from its pulse `first` on. */
void kernel_angles(const struct schedule_run *run, uint32_t first, uint32_t n, double *mirror_turn, double *pan_turn);
/* The same for a run with a table. */
void kernel_angles_table(const struct schedule_run *run, uint32_t first, uint32_t n, double *mirror_turn,
                         double *pan_turn);

/* Angles of the axes, in turns. */
struct kernel_turns {
    uint32_t n;
    const double *mirror, *pan;
};
/* The directions as the encoders read them, in whole counts. The directions are turned by `rotation`, and written to
 * e. */
struct kernel_reading {
    const struct cast_setup *setup; /* has the counts */
    const double *rotation;         /* from socs to the CRS or to prcs; unit matrix: e is in socs (aim.c) */
    struct vec3_out e;
};
/* Computes directions of beams in prcs: rotation times (sin p cos m, cos p cos m, sin m). With `reading` it
 * computes the directions that the encoders read, too; NULL: it does not. */
void kernel_directions(const struct kernel_turns *turns, const double rotation[9], const struct vec3_out *d,
                       const struct kernel_reading *reading);

#endif
