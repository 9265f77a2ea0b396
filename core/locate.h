/* SPDX-License-Identifier: MIT */
/* One place on the Earth: a check of it, its local axes, and its position, convergence and scale in a grid.
 * In: core/georef.h's struct georef_place. Degrees, metres; heights above the ellipsoid. Errors (SH_EINPUT)
 * say what is allowed. Any thread. */
#ifndef CORE_LOCATE_H
#define CORE_LOCATE_H

#include "core/georef.h"

/* Refuses a latitude or longitude out of range, and a height below the deepest sea or in space: there a unit
 * or a sign is wrong. */
int locate_check(const struct georef_place *place, struct sh_err *err);

/* ECEF, and the rotation of east, north, up there to X, Y, Z, row by row. Checks the place. */
int locate_axes(const struct georef_place *place, double p_ecef[3], double rotation[9], struct sh_err *err);

struct locate_grid {
    int zone, north; /* zone 0: UPS */
    double easting_m, northing_m;
    double convergence_deg; /* bearing of grid north, clockwise from true north */
    double scale;           /* grid metres per metre on the ellipsoid */
};
/* zone: 1..60, GEOREF_UPS, or 0: by position, UPS beyond 84 N and 80 S. Checks the place. */
int locate_in_grid(const struct georef_place *place, int zone, struct locate_grid *out, struct sh_err *err);

#endif
