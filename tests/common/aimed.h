/* SPDX-License-Identifier: MIT */
/* This finds where an ideal head that stands aims the pulses of a run. */
#ifndef TESTS_COMMON_AIMED_H
#define TESTS_COMMON_AIMED_H

#include "core/schedule.h"
#include "core/vec3.h"

/* Angles of mirror and pan, in turns, of n pulses of the run, from its pulse `first` on. */
void aimed_angles(const struct schedule_run *run, uint32_t first, uint32_t n, double *mirror_turn, double *pan_turn);
/* Directions of the run's pulses, turned by rotation. d has room for run->n. */
void aimed_directions(const struct schedule_run *run, const double rotation[9], const struct vec3_out *d);

#endif
