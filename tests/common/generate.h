/* SPDX-License-Identifier: MIT */
/* Generated scenes for measuring and tests: bumpy ground in a closed box; wires and railings; foliage. */
#ifndef TESTS_COMMON_GENERATE_H
#define TESTS_COMMON_GENERATE_H

#include "core/scene.h"

/* Makes about n_triangles: a height field on side_m x side_m about centre_m, rough by rough_m, a second one as ceiling
 * at 0.3 side_m, and walls between them. The scene is closed without a crack. Heights are hashed from the seed, so the
 * same call gives the same scene. The ground stays within +/- 0.6 rough_m of 0. */
int generate_terrain(uint32_t n_triangles, double side_m, double rough_m, const double centre_m[2], uint64_t seed,
                     struct scene **out, struct sh_err *err);

/* A straight round bar, as a prism of eight sides with caps. */
struct generate_bar {
    double a[3], b[3]; /* ends of its axis */
    double diameter_m;
    uint16_t label; /* from 1; label 0 is the backdrop */
};
/* Makes bars in front of a closed box of 2 half_m wide about the origin. */
int generate_bars(const struct generate_bar *bar, uint32_t n_bars, double half_m, struct scene **out,
                  struct sh_err *err);

/* Makes leaves, with label 1: single triangles of about size_m, turned at random, within a ball. The same box is behind
 * them. */
struct generate_crown {
    double centre_m[3], radius_m, size_m;
    uint32_t n_leaves;
};
int generate_foliage(const struct generate_crown *crown, uint32_t n_crowns, double half_m, uint64_t seed,
                     struct scene **out, struct sh_err *err);

#endif
