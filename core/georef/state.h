/* SPDX-License-Identifier: MIT */
/* Private to core/georef: what a georef consists of. georef.c fills it; axes.c and scale.c read it. Where the CRS is
 * linear in prcs, a rotation converts positions. Elsewhere a map does (struct shim_map in geographiclib_shim.h), or its
 * polynomial. Lengths are in metres, positions in prcs or in units of the CRS. */
#ifndef CORE_GEOREF_STATE_H
#define CORE_GEOREF_STATE_H

#include "core/georef.h"
#include "core/georef/polynomial.h"

struct georef {
    enum georef_crs crs;
    enum georef_method method;
    double station_m[3]; /* prcs */
    double origin[3];    /* the station in the CRS; only where there is no map */
    double centre_m[3];  /* prcs */
    double anchor[3];
    double rotation[9];   /* where there is no map: prcs -> CRS, row by row */
    struct shim_map *map; /* NULL: the CRS is linear in prcs */
    int has_geoid, from_grid, epsg;
    struct polynomial polynomial; /* of the map; half_m 0: none */
};

static inline int georef_has_map(const struct georef *georef)
{
    return georef->map != NULL;
}

void georef_degrees(const struct georef *georef, double height_m, double *lat_m, double *lon_m, double *axis_m);

#endif
