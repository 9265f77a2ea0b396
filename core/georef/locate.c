#include "core/locate.h"

#include <math.h>
#include <stddef.h>

#include "core/georef/geographiclib_shim.h"

/* As georef.c: lowest sea bed to the edge of space. */
#define HEIGHT_MIN_M (-12000.0)
#define HEIGHT_MAX_M 100000.0

static int check_height(double height_m, struct sh_err *err)
{
    if (height_m >= HEIGHT_MIN_M && height_m <= HEIGHT_MAX_M) return SH_OK; /* false for not-a-number */
    return sh_fail(err, SH_EINPUT, "height %.10g m above the ellipsoid; allowed %g to %g m", height_m, HEIGHT_MIN_M,
                   HEIGHT_MAX_M);
}

static int check_geodetic(double lat_deg, double lon_deg, struct sh_err *err)
{
    if (!(fabs(lat_deg) <= 90.0)) return sh_fail(err, SH_EINPUT, "latitude %.10g deg; allowed -90 to 90 deg", lat_deg);
    if (!(lon_deg >= -180.0 && lon_deg <= 360.0))
        return sh_fail(err, SH_EINPUT, "longitude %.10g deg; allowed -180 to 360 deg", lon_deg);
    return SH_OK;
}

int georef_locate_utm(int zone, int north, double easting_m, double northing_m, double height_m, double *lat_deg,
                      double *lon_deg, struct sh_err *err)
{
    char why[256] = "";
    *lat_deg = *lon_deg = NAN;
    if (zone < 0 || zone > 60) return sh_fail(err, SH_EINPUT, "UTM zone %d; allowed 1 to 60, or 0: UPS", zone);
    if (!isfinite(easting_m) || !isfinite(northing_m))
        return sh_fail(err, SH_EINPUT, "easting and northing are not finite numbers of metres");
    int rc = check_height(height_m, err);
    if (rc != SH_OK) return rc;
    if (shim_utm_reverse(zone, north, easting_m, northing_m, lat_deg, lon_deg, why, sizeof why) == 0) return SH_OK;
    return sh_fail(err, SH_EINPUT, "%s %d, %s: easting %.10g m, northing %.10g m lie off the grid (%s)",
                   zone == 0 ? "UPS" : "UTM zone", zone, north ? "north" : "south", easting_m, northing_m, why);
}

int georef_locate_ecef(const double p_ecef[3], double *lat_deg, double *lon_deg, double *height_m, struct sh_err *err)
{
    for (int i = 0; i < 3; i++)
        if (!isfinite(p_ecef[i])) return sh_fail(err, SH_EINPUT, "ECEF %c is not a finite number of metres", "XYZ"[i]);
    if (shim_ecef_reverse(p_ecef, lat_deg, lon_deg, height_m) != 0)
        return sh_fail(err, SH_EINPUT, "ECEF position can't be located");
    struct sh_err why = {0, ""};
    if (check_height(*height_m, &why) == SH_OK) return SH_OK;
    return sh_fail(err, SH_EINPUT, "ECEF %.10g %.10g %.10g is not near the Earth's surface: %s", p_ecef[0], p_ecef[1],
                   p_ecef[2], why.text);
}

int georef_geodetic_to_ecef(double lat_deg, double lon_deg, double height_m, double p_ecef[3], double rotation[9],
                            struct sh_err *err)
{
    double unused[9];
    int rc = check_geodetic(lat_deg, lon_deg, err);
    if (rc == SH_OK) rc = check_height(height_m, err);
    if (rc == SH_OK) shim_ecef(lat_deg, lon_deg, height_m, p_ecef, rotation != NULL ? rotation : unused);
    return rc;
}

int georef_geodetic_to_utm(double lat_deg, double lon_deg, int zone, struct georef_utm *out, struct sh_err *err)
{
    char why[256] = "";
    struct shim_utm utm;
    int rc = check_geodetic(lat_deg, lon_deg, err);
    if (rc != SH_OK) return rc;
    if (zone < 0 || zone > 60 || shim_utm_forward(lat_deg, lon_deg, zone, &utm, why, sizeof why) != 0)
        return sh_fail(err, SH_EINPUT, "UTM zone %d does not reach latitude %.10g, longitude %.10g%s%s%s", zone,
                       lat_deg, lon_deg, why[0] != '\0' ? " (" : "", why, why[0] != '\0' ? ")" : "");
    *out = (struct georef_utm){.zone = utm.zone,
                               .north = utm.north,
                               .easting_m = utm.easting_m,
                               .northing_m = utm.northing_m,
                               .convergence_deg = utm.convergence_deg,
                               .scale = utm.scale};
    return SH_OK;
}
