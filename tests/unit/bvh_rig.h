/* SPDX-License-Identifier: MIT */
/* For tests of the BVH alone: a few triangles about ORIGIN. */
#ifndef TESTS_UNIT_BVH_RIG_H
#define TESTS_UNIT_BVH_RIG_H

#include "tests/common/made.h"

extern const double ORIGIN[3]; /* prcs, m */

/* Makes a scene with surfaces 0 and 1. With label NULL all triangles are of surface 0. */
struct scene *scene_of(const double (*vertex)[3], uint32_t n_vertices, const uint32_t (*triangle)[3], uint32_t n,
                       const uint16_t *label);

#endif
