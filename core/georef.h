/* SPDX-License-Identifier: MIT */
/* From the scene's frame (prcs) to a coordinate reference system (CRS), through GeographicLib.
 *
 * In: points of the scene, as differences from a centre in metres. Out: differences from the anchor in the
 * CRS. The anchor is the centre's position in the CRS, so anchor + difference is the point's position, and
 * large coordinates lose no digits. The centre is the station, until georef_recentre moves it.
 *
 * The scene's frame is one of these: the tangent frame of the station (x east, y north, z up along the
 * ellipsoid's normal); the tangent frame of another place, turned against it (rotation); a grid.
 * The CRS is one of these:
 *   local     prcs itself: metres in the mesh's frame
 *   ecef      WGS 84 geocentric X, Y, Z: a rotation and a shift
 *   utm       easting, northing (with false origin), height. Zone automatic or forced; UPS beyond 84 N and 80
 *             S when it is automatic. Grid convergence and scale are part of the map. Where the scene is
 *             itself in a grid, utm_zone 0 means that grid; positions in it are the scene's own coordinates.
 *   geodetic  latitude and longitude in degrees, height; longitude differences the short way round, in
 *             -180..180
 *
 * Methods. Exact calls GeographicLib for each point (about 0.2 us for geodetic, 0.9 us for utm; `make
 * chart`). Order 1, 2, 3 evaluate the map's Taylor polynomial about the centre in a few ns, within georef_bound_m.
 * Order 5 exists where heights stay the same: from a grid to another grid, or from a UTM grid to geodetic. In
 * geodetic output longitude has a closed form (georef/polynomial.h). So the orders may be used near a pole, too,
 * down to a distance of a few radii of the scene.
 * Only a map that is not linear has polynomials. Local, ecef from a metric frame, and the scene's own grid are
 * linear, and exact with every method.
 *
 * Heights are ellipsoidal, or above a geoid (interpolated for each point: method exact only). Thread: a
 * georef is constant after creation and georef_set_method. */
#ifndef CORE_GEOREF_H
#define CORE_GEOREF_H

#include <stddef.h>

#include "core/err.h"
#include "core/vec3.h"

enum georef_crs { GEOREF_LOCAL, GEOREF_ECEF, GEOREF_UTM, GEOREF_GEODETIC };
enum georef_method { GEOREF_AUTO, GEOREF_EXACT, GEOREF_ORDER1, GEOREF_ORDER2, GEOREF_ORDER3, GEOREF_ORDER5 };

struct georef_geoid;

/* The value of georef_spec.utm_zone that means UPS. */
enum { GEOREF_UPS = -1 };

struct georef_spec {
    enum georef_crs crs;
    double station_m[3];     /* the head's origin in prcs */
    double lat_deg, lon_deg; /* geodetic, WGS 84, of the head's origin */
    double height_m;         /* ellipsoidal, whatever the output's heights are */
    int utm_zone;            /* 1..60, GEOREF_UPS, or 0: by position */
    int side;                /* utm: hemisphere of the false northing; 1: north, -1: south, 0: by position */
    /* How prcs lies at the station, where prcs is not the station's tangent frame (see core/geoframe.h): */
    double rotation[9]; /* differences in prcs -> east, north, up at the station, row by row; all 0: the same axes */
    int prcs_is_grid;   /* 1: prcs is easting, northing, height of a grid, and station_m the station's */
    int prcs_zone;      /* its zone: 1..60, or 0: UPS */
    int prcs_north;     /* its hemisphere: 1 or 0 */
    /* Heights of the output are above this geoid (utm, geodetic); NULL: ellipsoidal. Must outlive the georef. */
    const struct georef_geoid *geoid;
};

/* A place on WGS 84. */
struct georef_place {
    double lat_deg, lon_deg; /* -90..90, -180..180; a longitude that comes in may be up to 360 */
    double height_m;         /* ellipsoidal */
};

/* The place of a position in a grid: grid_m is easting and northing, with false origin, and ellipsoidal
 * height. zone: 1..60, or 0: UPS; north: hemisphere of the false origin. SH_EINPUT: not finite, or outside of
 * the grid. */
int georef_locate_utm(int zone, int north, const double grid_m[3], struct georef_place *out, struct sh_err *err);
/* The place of a position in ECEF, and back. A latitude outside of -90..90 degrees gives a position of NaN. */
int georef_locate_ecef(const double p_ecef[3], struct georef_place *out, struct sh_err *err);
void georef_geodetic_to_ecef(const struct georef_place *place, double p_ecef[3]);

/* GeographicLib's geoid data (egm96-5 unless GEOGRAPHICLIB_GEOID_NAME says another), read into memory: 19 MB.
 * SH_EINPUT when it is not installed. */
int georef_geoid_open(struct georef_geoid **out, struct sh_err *err);
void georef_geoid_free(struct georef_geoid *geoid);

struct georef;

/* The method is exact at first. Takes a millisecond where there are polynomials to fit. */
int georef_create(const struct georef_spec *spec, struct georef **out, struct sh_err *err);
void georef_free(struct georef *georef);

/* Makes a georef about another centre, for a head that moves or ranges that no longer fit. Scene frame,
 * CRS, zone and false origin are the same; polynomials and anchor are about centre_m (prcs). SH_EINPUT
 * where the zone does not reach, or where the method needs a polynomial and there is none, as close to a pole. The
 * method stays the same, but its bound may change. */
int georef_recentre(const struct georef *georef, const double centre_m[3], struct georef **out, struct sh_err *err);

/* The centre in the CRS, to which the differences are added. */
void georef_anchor(const struct georef *georef, double anchor[3]);

/* EPSG code of the CRS: 4978 for ECEF, 4979 for geodetic, 326zz/327zz for UTM, 32661/32761 for UPS, 0 for
 * local. */
int georef_epsg(const struct georef *georef);

enum georef_crs georef_crs(const struct georef *georef);

/* 1: heights are above the geoid; 0: above the ellipsoid. */
int georef_has_geoid(const struct georef *georef);

/* The output's grid at the centre: bearing of grid north, clockwise from true north, and metres of grid
 * per metre on the ellipsoid. 0 and 1 where there is no grid, or it is the scene's own. */
void georef_convergence(const struct georef *georef, double *convergence_rad, double *scale);

/* 1 and the matrix, row by row, where differences from the anchor are a rotation of those in prcs; else 0. */
int georef_rotation(const struct georef *georef, double rotation[9]);

/* Differences in prcs at the centre -> axes of the CRS (geodetic: east, north, up), row by row: the map's
 * rotation there, without its scale. */
void georef_axes(const struct georef *georef, double rotation[9]);

/* Sets what georef_forward uses. SH_EINPUT: GEOREF_AUTO, or an order that has no polynomial here. To be
 * called before other threads see the georef. */
int georef_set_method(struct georef *georef, enum georef_method method, struct sh_err *err);
enum georef_method georef_method(const struct georef *georef);

/* The bound of a method's error, metres on the ground, for points within radius_m (horizontally) and
 * height_m (up or down) of the centre; INFINITY where it is not known. polynomial.c derives it. */
double georef_bound_m(const struct georef *georef, enum georef_method method, double radius_m, double height_m);

/* n points, d_prcs relative to the centre (metres) -> difference from the anchor, in units of the CRS
 * (metres; geodetic: degrees, degrees, metres). In place is allowed. NaN goes through. */
void georef_forward(const struct georef *georef, size_t n, struct vec3_in d, struct vec3_out out);

/* One point back, exact: difference from the anchor -> prcs (absolute). For checks and clients, not for
 * speed. */
void georef_reverse(const struct georef *georef, const double d_crs[3], double p_prcs[3]);

/* Position in the CRS minus anchor, the short way round in longitude. */
void georef_difference(const struct georef *georef, const double p_crs[3], double d_crs[3]);

/* Sets scale to the units of the CRS per count, for points within reach_m of the centre. A count is at most scale_m on
 * the ground (utm, ecef, local: just scale_m, of the grid). Counts fit into 31 bits and a sign. Degrees of longitude
 * have a scale of their own: near a pole, differences are large in degrees and short on the ground. Where 360 degrees
 * don't fit otherwise, the scale of longitude alone is coarser, up to 2 pi reach_m / 2^31 on the ground. SH_EINPUT
 * where another coordinate does not fit; the text names the smallest scale_m that would do. */
int georef_scale(const struct georef *georef, double scale_m, double reach_m, double scale[3], struct sh_err *err);
/* The largest coordinate of points within reach_m of the centre, relative to the anchor, in metres: more than reach_m
 * by the grid's scale, the geoid and the Earth's curvature. Longitude is left out, since its scale follows. */
double georef_span_m(const struct georef *georef, double reach_m);
/* The largest length of one count of these scales within reach_m, metres (on the ground, or of the grid):
 * scale_m, or that of longitude. */
double georef_count_m(const struct georef *georef, double reach_m, const double scale[3]);

/* A point east, north and up (metres) in the tangent frame at a place on WGS 84 -> its own latitude and
 * longitude (deg, longitude -180..180) and ellipsoidal height (m). GeographicLib's LocalCartesian; for single
 * points, not for speed. */
void georef_geodetic(double lat_deg, double lon_deg, double height_m, const double d_enu[3], double geodetic[3]);

#endif
