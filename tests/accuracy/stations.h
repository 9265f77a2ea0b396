/* SPDX-License-Identifier: MIT */
/* Places all over the Earth, points about them, and the distance between two methods' results. */
#ifndef TESTS_ACCURACY_STATIONS_H
#define TESTS_ACCURACY_STATIONS_H

#include <stdint.h>

#include "core/georef.h"

enum { STATIONS = 200, STATIONS_BATCH = 1250 };

/* Eight places in turn: four in the zone where they lie, one that is forced into the neighbouring zone, one in UPS, one
 * at 83.9 N, one at the antimeridian. The forced one lies up to 1.4 degrees beyond the border, as far as that zone
 * reaches on the equator. Heights go from the Dead Sea to a drone over the Himalaya. */
struct georef_spec station_spec(int i, enum georef_crs crs);

struct station_points {
    double in[3][STATIONS_BATCH], out[3][STATIONS_BATCH], exact[3][STATIONS_BATCH];
};

/* Scatters points evenly within the cylinder. Every eighth is on its rim, where errors are largest. */
void station_scatter(struct station_points *p, uint64_t stream, double radius_m, double height_m);

void station_forward(const struct georef *georef, struct station_points *p, double out[3][STATIONS_BATCH]);

/* Returns the largest distance of `out` from `exact`, on the ground. */
double station_error_m(const struct georef *georef, const struct station_points *p);

/* Returns a number that is uniform in 0..1. */
double station_unit(uint64_t stream, uint64_t i);

#endif
