/* SPDX-License-Identifier: MIT */
/* For tests of georeferencing: the ellipsoid, one station, comparisons. */
#ifndef TESTS_UNIT_GEOREF_RIG_H
#define TESTS_UNIT_GEOREF_RIG_H

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "core/georef.h"
#include "tests/common/cases.h"

#define PI 3.14159265358979323846
/* WGS 84, NIMA TR8350.2: a and 1/f define it, and the rest follows. */
#define A_M 6378137.0
#define F   (1 / 298.257223563)
#define B_M (A_M * (1 - F))
#define E2  (F * (2 - F))
/* Positions are near 6.4e6 m, where doubles are 9.3e-10 m apart. A chain of some tens of operations stays below ten
 * such steps. GeographicLib states 5 nm for each direction of UTM. */
#define TOL_M 1e-8

struct georef *make(enum georef_crs crs, double lat_deg, double lon_deg, double height_m, int zone);

void expect_near(double got, double want, double tolerance);

void expect_point(const double got[3], double x, double y, double z, double tolerance);

void forward_one(const struct georef *georef, const double d[3], double out[3]);

#endif
