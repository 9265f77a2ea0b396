/* SPDX-License-Identifier: MIT */
/* For tests of poses. */
#ifndef TESTS_UNIT_POSE_RIG_H
#define TESTS_UNIT_POSE_RIG_H

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/pose.h"
#include "tests/common/cases.h"

extern const double DEG;

/* Finds the knots with the rules that the program uses. */
int find_path(const struct trajectory *tr, double start_s, double end_s, const struct pose *mount,
              struct pose_path *out, struct sh_err *err);

#endif
