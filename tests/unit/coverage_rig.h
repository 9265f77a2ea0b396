/* SPDX-License-Identifier: MIT */
/* For tests of coverage: closed rooms, a head that looks everywhere, and the visible walls of an L-shaped room, worked
 * out by hand. */
#ifndef TESTS_UNIT_COVERAGE_RIG_H
#define TESTS_UNIT_COVERAGE_RIG_H

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

#include "core/studio/coverage.h"
#include "core/vec3.h"

/* This is a room with a coverage. */
struct cover {
    struct scene *scene;
    struct bvh *bvh;
    struct coverage *coverage;
};

/* Takes the scene over, and makes its BVH. Fails the test where that is not possible. */
struct cover *cover_open(struct scene *scene, double cell_m, unsigned threads);
void cover_close(struct cover *cover);

/* Makes a box with faces inward; its labels are 0..5. */
struct scene *cover_box(const double lo[3], const double hi[3]);

/* The L is (0, 0) (6, 0) (6, 2) (2, 2) (2, 5) (0, 5), from z = 0 to L_HEIGHT_M. The walls go round in that order, each
 * of two triangles; then come floor and ceiling. */
#define L_HEIGHT_M 2.4
struct scene *cover_l_room(void);

/* A head that stands level: lines from low_deg to high_deg, pans from pan0_deg to pan1_deg, all steps step_deg. */
struct cover_sweep {
    double step_deg, low_deg, high_deg, pan0_deg, pan1_deg, range_max_m;
};
extern const struct cover_sweep cover_everywhere; /* half a degree, with sanitizers 3; up to 1000 m */
void cover_scan(const struct cover *cover, const double station_m[3], const struct cover_sweep *sweep,
                struct coverage_scan *scan);

/* Casts it, and keeps it as the scan of a station. */
void cover_look(struct cover *cover, const double station_m[3], const struct cover_sweep *sweep,
                struct coverage_pulses *pulses);

/* A cell, computed from its pieces. */
struct cover_cell {
    double least_m; /* the largest area over perimeter of a piece: a circle of this radius fits into a convex polygon */
    double low_m[3], high_m[3], area_m2;
    uint32_t corners, seen;       /* of all corners, those that `sees` returns 1 for */
    double farthest_m, nearest_m; /* corners from the station */
    double spacing_m; /* largest distance of neighbouring points at a corner: range^2 step / distance from the plane */
};
/* Writes cell[coverage_cells]; sees may be NULL. */
void cover_cells(const struct cover *cover, const double station_m[3], double step_deg,
                 int (*sees)(const double p_m[3]), struct cover_cell *cell);

double cover_area(const struct scene *scene);

#endif
