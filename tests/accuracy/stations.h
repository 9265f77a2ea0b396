/* SPDX-License-Identifier: MIT */
/* Places all over the Earth, points about them, and how far two methods are apart. */
#ifndef TESTS_ACCURACY_STATIONS_H
#define TESTS_ACCURACY_STATIONS_H

#include <stdint.h>

#include "core/georef.h"

enum { STATIONS = 200, STATIONS_BATCH = 1250 };

/* Of eight: four in a zone of their own, one each forced into the neighbouring zone from up to 1.4 degrees beyond
 * the border, as far as that zone reaches on the equator, in UPS, at 83.9 N, at the antimeridian. Heights from the Dead
 * Sea to a drone over the Himalaya. */
struct georef_spec station_spec(int i, enum georef_crs crs);

struct station_points {
    double in[3][STATIONS_BATCH], out[3][STATIONS_BATCH], exact[3][STATIONS_BATCH];
};

/* Within the cylinder, evenly; every eighth on its rim, where errors are largest. */
void station_scatter(struct station_points *p, uint64_t stream, double radius_m, double height_m);

void station_forward(const struct georef *georef, struct station_points *p, double out[3][STATIONS_BATCH]);

/* Of out against exact, on the ground. */
double station_error_m(const struct georef *georef, const struct station_points *p);

/* Uniform in 0..1. */
double station_unit(uint64_t stream, uint64_t i);

#endif
