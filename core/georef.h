/* Scene frame -> coordinate reference system, through GeographicLib (georef/geographiclib_shim.cpp is the only C++).
 *
 * The scene frame is the local tangent frame of the station: x east, y north, z up along the ellipsoid's normal,
 * with the station's prcs position at (lat, lon, height); or that of another place, turned against it (rotation); or a
 * grid, whose points go through its projection one by one, except to the same grid: there they are what they are, and
 * utm_zone 0 means that grid. Coordinates leave as differences from the anchor, the
 * station in the CRS, so that nothing is lost to large numbers; the sum anchor + difference is the position.
 *   local  prcs as it is: metres in the mesh's frame
 *   ecef   WGS 84 geocentric X, Y, Z: a rotation and a shift, exact
 *   utm    easting, northing (with false origin), ellipsoidal height; zone automatic or forced. GeographicLib's
 *          UTMUPS, exact per point (about 0.9 us); UPS beyond 84 N and 80 S when the zone is automatic.
 * Thread: a georef is constant after creation. */
#ifndef CORE_GEOREF_H
#define CORE_GEOREF_H

#include <stddef.h>

#include "core/err.h"

enum georef_crs { GEOREF_LOCAL, GEOREF_ECEF, GEOREF_UTM, GEOREF_GEODETIC };

struct georef_spec {
    enum georef_crs crs;
    double station_m[3];     /* the head's origin in prcs */
    double lat_deg, lon_deg; /* geodetic, WGS 84, of the head's origin */
    double height_m;         /* ellipsoidal */
    int utm_zone;            /* 1..60, or 0: by position */
    /* How prcs lies at the station, where it is not its tangent frame (see core/geoframe.h): */
    double rotation[9]; /* differences in prcs -> east, north, up at the station, row by row; all 0: the same axes */
    int prcs_is_grid;   /* 1: prcs is easting, northing, height of a grid, and station_m the station's */
    int prcs_zone;      /* its zone: 1..60, or 0: UPS */
    int prcs_north;     /* its hemisphere: 1 or 0 */
};

/* A place on WGS 84. */
struct georef_place {
    double lat_deg, lon_deg; /* -90..90, -180..180 */
    double height_m;         /* ellipsoidal */
};

/* Where a position in another system lies. zone 1..60, or 0: UPS; north: hemisphere of the false origin; easting and
 * northing with it; height ellipsoidal. SH_EINPUT: not finite, or outside of what UTMUPS takes. GeographicLib. */
int georef_locate_utm(int zone, int north, double easting_m, double northing_m, double height_m,
                      struct georef_place *out, struct sh_err *err);
int georef_locate_ecef(const double p_ecef[3], struct georef_place *out, struct sh_err *err);

/* And back. Not-a-number outside of -90..90 degrees of latitude. zone 0: by position, and *zone_used 0 where that is
 * UPS; the three out-parameters may be NULL but grid (easting, northing, height). */
void georef_geodetic_to_ecef(const struct georef_place *place, double p_ecef[3]);
int georef_geodetic_to_utm(const struct georef_place *place, int zone, int *zone_used, int *north, double grid[3],
                           struct sh_err *err);

struct georef;

int georef_create(const struct georef_spec *spec, struct georef **out, struct sh_err *err);
void georef_free(struct georef *georef);

/* The station in the CRS: what the differences are added to. */
void georef_anchor(const struct georef *georef, double anchor[3]);

/* EPSG code of the CRS: 4978 for ECEF, 326zz/327zz for UTM, 32661/32761 for UPS, 0 for local. */
int georef_epsg(const struct georef *georef);

/* Where differences from the anchor are a rotation of those in prcs (local, ecef): 1 and its matrix, row by row. Else
 * 0. */
int georef_rotation(const struct georef *georef, double rotation[9]);

/* n points, d_prcs relative to the station (metres) -> difference from the anchor. In place is allowed.
 * Not-a-number goes through. */
void georef_forward(const struct georef *georef, size_t n, const double *dx, const double *dy, const double *dz,
                    double *out_x, double *out_y, double *out_z);

/* One point back: difference from the anchor -> prcs (absolute). For checks and clients, not for speed. */
void georef_reverse(const struct georef *georef, const double d_crs[3], double p_prcs[3]);

#endif
