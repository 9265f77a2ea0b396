/* SPDX-License-Identifier: MIT */
/* This is the plain way to cast with Embree. The stability table shows it beside ours. The plain way has one float mesh
 * with shared vertices, float rays, and the range as Embree gives it. */
#ifndef TESTS_STABILITY_NAIVE_H
#define TESTS_STABILITY_NAIVE_H

#include <stdint.h>

#include "core/scene.h"

struct naive;

/* Makes the mesh minus origin_m in float. With an origin of 0 it has the scene's own coordinates. Returns NULL where
 * there is no memory. */
struct naive *naive_create(const struct scene *scene, const double origin_m[3], int robust, unsigned build_threads);
void naive_free(struct naive *naive);

/* `packet` is 1, 4, 8 or 16 rays per call. The range is NaN and the triangle UINT32_MAX where nothing is met. Any
 * number of threads may call it at once. */
void naive_hits(const struct naive *naive, unsigned packet, const double station_m[3], uint32_t n, const double *dx,
                const double *dy, const double *dz, double *range_m, uint32_t *triangle);

#endif
