/* SPDX-License-Identifier: MIT */
/* Private to core/cast: this finds when the pulses of a run are fired. */
#ifndef CORE_CAST_KERNELS_TIMES_H
#define CORE_CAST_KERNELS_TIMES_H

#include "core/schedule.h"

/* Computes firing times after the run's first pulse: j * quot + floor((acc + j * rem) / den). j is the number of pulses
 * since then; in a run with a table of offsets it is the number of the sequence's ticks. */
void kernel_times(const struct schedule_run *run, uint32_t *dt_ns);

#endif
