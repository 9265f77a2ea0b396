/* Scene frame -> coordinate reference system, through GeographicLib (georef/geographiclib_shim.cpp is the only C++).
 *
 * The scene frame is the local tangent frame of the station: x east, y north, z up along the ellipsoid's normal,
 * with the station's prcs position at (lat, lon, height). Coordinates leave as differences from the anchor, the
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

enum georef_crs { GEOREF_LOCAL, GEOREF_ECEF, GEOREF_UTM };

struct georef_spec {
    enum georef_crs crs;
    double station_m[3];     /* the head's origin in prcs */
    double lat_deg, lon_deg; /* geodetic, WGS 84, of the head's origin */
    double height_m;         /* ellipsoidal */
    int utm_zone;            /* 1..60, or 0: by position */
};

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

/* A point east, north and up (metres) in the tangent frame at a place on WGS 84 -> its own latitude and longitude (deg,
 * longitude -180..180) and ellipsoidal height (m). GeographicLib's LocalCartesian; for single points, not for speed. */
void georef_geodetic(double lat_deg, double lon_deg, double height_m, const double d_enu[3], double geodetic[3]);

#endif
