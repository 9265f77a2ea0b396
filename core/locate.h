/* Places on the Earth from one form to another: geodetic (WGS 84), ECEF, UTM and UPS. Single places, for setting up;
 * points go through core/georef.h. GeographicLib, good to some nanometres.
 * Degrees, metres; heights above the ellipsoid. Errors (SH_EINPUT) say what is allowed. Thread: any. */
#ifndef CORE_LOCATE_H
#define CORE_LOCATE_H

#include "core/err.h"

/* UTM zone 1..60, or 0: UPS; north: hemisphere, 1 or 0. Refuses what lies off the grid's table. */
int georef_locate_utm(int zone, int north, double easting_m, double northing_m, double height_m, double *lat_deg,
                      double *lon_deg, struct sh_err *err);

/* Refuses a point below the deepest sea or in space: there a unit or a sign is wrong. */
int georef_locate_ecef(const double p_ecef[3], double *lat_deg, double *lon_deg, double *height_m, struct sh_err *err);

/* And the rotation of east, north, up there to X, Y, Z, row by row; rotation may be NULL. */
int georef_geodetic_to_ecef(double lat_deg, double lon_deg, double height_m, double p_ecef[3], double rotation[9],
                            struct sh_err *err);

struct georef_utm {
    int zone, north; /* zone 0: UPS */
    double easting_m, northing_m;
    double convergence_deg; /* bearing of grid north, clockwise from true north */
    double scale;           /* grid metres per metre on the ellipsoid */
};
/* zone: 1..60, or 0: by position, UPS beyond 84 N and 80 S. */
int georef_geodetic_to_utm(double lat_deg, double lon_deg, int zone, struct georef_utm *out, struct sh_err *err);

#endif
