/* SPDX-License-Identifier: MIT */
/* Private to core/cast: where the axes of a run turn evenly, its directions cost a fraction of those of
 * kernels_aim.h. */
#ifndef CORE_CAST_KERNELS_SWEEP_H
#define CORE_CAST_KERNELS_SWEEP_H

#include "core/cast/kernels_aim.h"

enum { KERNEL_BLOCK = 64 };
/* A step is the angle that an axis turns from one pulse to the next. The struct is a table of the sine, and of the
 * cosine minus 1, of -32 to 31 steps, for the mirror (sm, cm) and the pan (sp, cp). */
struct kernel_steps {
    int ready;
    double mirror_turn, pan_turn; /* a step */
    double sm[KERNEL_BLOCK], cm[KERNEL_BLOCK], sp[KERNEL_BLOCK], cp[KERNEL_BLOCK];
};
/* Computes the steps of a run, unless they are those of the run before. 0 where the run has a table, or its steps
 * are too large. */
int kernel_sweep_steps(struct kernel_steps *steps, const struct schedule_run *run);
/* Up to BVH_CHUNK pulses of a run, from its pulse `first` on. The struct is not called kernel_sweep: clang 19 crashes
 * where a struct has the name of a function that is compiled for several instruction sets (VEC_CLONES). */
struct kernel_pulses {
    const struct schedule_run *run;
    uint32_t first;
    struct kernel_turns turns; /* from kernel_angles */
};
/* As kernel_directions. */
void kernel_sweep(const struct kernel_steps *steps, const struct kernel_pulses *sweep, const double rotation[9],
                  const struct vec3_out *d, const struct kernel_reading *reading);

#endif
