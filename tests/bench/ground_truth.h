/* SPDX-License-Identifier: MIT */
/* This computes for the chart where a ray really hits. It is Moeller and Trumbore's test in long double over all
 * triangles in those cells of a plain grid (x, y) that the ray passes over. It shares nothing with core/cast or
 * Embree. */
#ifndef TESTS_BENCH_GROUND_TRUTH_H
#define TESTS_BENCH_GROUND_TRUTH_H

#include "core/scene.h"

struct ground_truth;

/* Returns NULL without memory. The scene must outlive the result. */
struct ground_truth *ground_truth_create(const struct scene *scene, const double station_m[3]);
void ground_truth_free(struct ground_truth *reference);
/* Returns the range of the first hit along dir from the station, or infinity. Sets *doubtful for a ray that grazes a
 * silhouette, or two faces of a sharp edge, very closely. A change of 1e-11 of a triangle's size would then make it hit
 * something else. */
long double ground_truth_range(const struct ground_truth *reference, const double dir[3], int *doubtful);

#endif
