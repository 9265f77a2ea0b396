/* SPDX-License-Identifier: MIT */
/* The parts of GeographicLib that are used, for C. The shim also defines georef_geodetic and georef_geoid_free. Only
 * the files of core/georef include this. Angles are in degrees, lengths in metres. No exception leaves it: each
 * becomes a text, or NaN. */
#ifndef CORE_GEOREF_GEOGRAPHICLIB_SHIM_H
#define CORE_GEOREF_GEOGRAPHICLIB_SHIM_H

#include <stddef.h>

#ifdef __cplusplus
extern "C" {
#endif

#include "core/locate.h"
#include "core/vec3.h"

/* WGS 84 geocentric position, and the rotation (row by row) of east, north, up at it to X, Y, Z. */
void shim_ecef(double lat_deg, double lon_deg, double height_m, double p_ecef[3], double rotation[9]);

/* Geodetic place (degrees, degrees, metres) of a geocentric position; NaN on failure. */
void shim_locate_ecef(const double p_ecef[3], double place[3]);
/* Finds the degrees of a place from easting and northing in a UTM zone, or in UPS for zone 0. Returns 0, or -1 with
 * the reason. */
int shim_locate_utm(int zone, int north, const double grid[2], struct georef_place *out, char *why, size_t len);
/* Finds a place in a grid. zone: as for locate_in_grid. Returns 0, or -1 with the reason. */
int shim_grid_at(const struct georef_place *place, int zone, struct locate_grid *out, char *why, size_t len);

/* The default geoid with cubic interpolation, wholly in memory. NULL on failure, with the reason. */
struct georef_geoid *shim_geoid_open(char *why, size_t len);

/* From the scene frame about a centre to a grid zone, geodetic coordinates or ECEF. */
struct shim_map;

/* spec: checked, of a CRS other than local. Where the scene frame is no grid, spec->rotation must be a rotation; all 0
 * is not allowed here. NULL on failure, with the reason. */
struct shim_map *shim_map_create(const struct georef_spec *spec, char *why, size_t len);
/* The same frame and zone about another centre, given as difference in prcs. */
struct shim_map *shim_map_recentre(const struct shim_map *map, const double d_prcs[3], char *why, size_t len);
void shim_map_free(struct shim_map *map);

/* The anchor, at the centre. In utm it is easting and northing with false origin, and the height as it is sent. In
 * geodetic it is latitude and longitude in degrees, and that height. In ecef it is X, Y and Z. */
void shim_map_anchor(const struct shim_map *map, double anchor[3]);
/* The place of the centre: degrees, degrees, ellipsoidal height. */
void shim_map_place(const struct shim_map *map, double place[3]);
/* The figures that longitude depends on: how differences in prcs lie relative to the centre's meridian. */
struct shim_meridian {
    double turn[9];          /* differences in prcs -> east, north, up at the centre, row by row */
    double axis_m;           /* from the Earth's axis, or from the pole in a UPS grid */
    double sin_lat, cos_lat; /* components of up and of north along the Earth's axis; in a UPS grid those at the pole */
};
/* Returns 0 where there are none, since the scene frame is a UTM grid; else 1. */
int shim_map_meridian(const struct shim_map *map, struct shim_meridian *out);
/* The EPSG code of the CRS. */
int shim_map_epsg(const struct shim_map *map);
void shim_map_convergence(const struct shim_map *map, double *convergence_deg, double *scale);

/* Differences in prcs from the centre <-> differences from the anchor. In place is allowed. */
void shim_map_forward(const struct shim_map *map, size_t n, struct vec3_in d, struct vec3_out out);
void shim_map_reverse(const struct shim_map *map, const double d_map[3], double d_prcs[3]);

#ifdef __cplusplus
}
#endif
#endif
