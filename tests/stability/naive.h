/* SPDX-License-Identifier: MIT */
/* The plain way to cast with Embree, which the stability table shows beside ours: one float mesh with shared
 * vertices, float rays, the range as Embree tells it. */
#ifndef TESTS_STABILITY_NAIVE_H
#define TESTS_STABILITY_NAIVE_H

#include <stdint.h>

#include "core/scene.h"

struct naive;

/* The mesh minus origin_m in float; origin 0: the scene's own coordinates. NULL: no memory. */
struct naive *naive_create(const struct scene *scene, const double origin_m[3], int robust, unsigned build_threads);
void naive_free(struct naive *naive);

/* packet: 1, 4, 8 or 16 rays per call. Range NaN and triangle UINT32_MAX where nothing is met. Thread: any
 * number at once. */
void naive_hits(const struct naive *naive, unsigned packet, const double station_m[3], uint32_t n, const double *dx,
                const double *dy, const double *dz, double *range_m, uint32_t *triangle);

#endif
