/* SPDX-License-Identifier: MIT */
/* The ranges that a scanner must see in the living room of the house: the ready configurations' mesh and a mark, cast
 * by the reference of tests/common, which shares nothing with core/cast. The mark is a post to the right of the head,
 * and there is none on other sides. A scan that is mirrored, turned or shifted does not fit. */
#ifndef TESTS_WIRE_HOUSE_H
#define TESTS_WIRE_HOUSE_H

#include <math.h>

#include "tests/wire/wire.h"

struct house;

/* Returns options that put the mark into a ready configuration and turn the head to HOUSE_HEADING_DEG, with ideal
 * ranges and one ray a pulse. `ptys` are the links that are terminals; their paths are moved to the test's folder. The
 * result ends with NULL, and is good until the next call. `more` has further options and ends with NULL, or is NULL.
 * Skips the test where the house is not installed. */
const char *const *house_options(const struct wire *wire, const char *ptys, const char *const *more);

extern const double HOUSE_HEADING_DEG;

/* Call house_options first: it writes the mark. */
struct house *house_load(const struct wire *wire);
void house_free(struct house *house);

/* Returns metres along a direction of the head's frame; NaN: nothing. azimuth: clockwise from the head's y axis. */
double house_range_m(const struct house *house, double azimuth_rad, double elevation_rad);

/* Returns 1 where the mark is met. */
int house_is_mark(const struct house *house, double azimuth_rad, double elevation_rad);

/* Returns whether a measured range (0: none) is that along the direction to tolerance_m, within limits of the device.
 * Near an outline that is within spread_rad of the direction, either side of it is right. */
int house_agrees(const struct house *house, double azimuth_rad, double elevation_rad, double spread_rad, double range_m,
                 double tolerance_m, double min_m, double max_m);

#endif
