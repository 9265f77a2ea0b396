/* SPDX-License-Identifier: MIT */
/* Places in a named coordinate reference system: a national grid, as maps, terrain models and building models have it.
 * In: the system's name ("EPSG:2056", or as the EPSG registry calls it) and coordinates in metres. Out: the place on
 * the Earth, and how the grid lies there. PROJ computes this from its tables on this machine, without network.
 *
 * Coordinates are metres even where the grid itself is in feet. The result is on WGS 84. Between datums PROJ takes
 * its best transformation; accuracy_m is the accuracy of that one. Any thread. */
#ifndef CORE_CRS_H
#define CORE_CRS_H

#include "core/err.h"
#include "core/georef.h"

struct crs_place {
    struct georef_place at; /* height_m is passed through */
    double convergence_rad; /* grid north, clockwise from true north */
    double scale;           /* length in the grid / true length, on the ellipsoid */
    double accuracy_m;      /* of the transformation between datums; NaN: not known */
};

/* SH_EINPUT: an unknown name, a system that is not projected, a place more than 2 degrees outside of its area of use,
 * or no PROJ on this machine. */
int crs_locate(const char *name, double easting_m, double northing_m, double height_m, struct crs_place *place,
               struct sh_err *err);

/* Metres per unit of a projected system's axes, or of a vertical one's, which must point up. SH_EINPUT: an unknown
 * name, or another kind of system. */
int crs_unit(const char *name, int is_vertical, double *unit_m, struct sh_err *err);

#endif
