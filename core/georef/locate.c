/* SPDX-License-Identifier: MIT */
/* Places on WGS 84 from and to other systems, one at a time. */
#include "core/locate.h"

#include <math.h>
#include <stddef.h>
#include <stdio.h>

#include "core/georef/geographiclib_shim.h"

/* Lowest sea bed to the edge of space: beyond, a unit or a sign is wrong. */
static const double HEIGHT_MIN_M = -12000.0, HEIGHT_MAX_M = 100000.0;

int locate_check(const struct georef_place *place, struct sh_err *err)
{
    /* each is false for NaN */
    if (!(fabs(place->lat_deg) <= 90.0))
        return sh_fail(err, SH_EINPUT, "latitude %.10g deg; allowed -90 to 90 deg", place->lat_deg);
    if (!(place->lon_deg >= -180.0 && place->lon_deg <= 360.0))
        return sh_fail(err, SH_EINPUT, "longitude %.10g deg; allowed -180 to 360 deg", place->lon_deg);
    if (!(place->height_m >= HEIGHT_MIN_M && place->height_m <= HEIGHT_MAX_M))
        return sh_fail(err, SH_EINPUT,
                       "not near the Earth's surface: height %.10g m above the ellipsoid; allowed %g to %g m",
                       place->height_m, HEIGHT_MIN_M, HEIGHT_MAX_M);
    return SH_OK;
}

int locate_axes(const struct georef_place *place, double p_ecef[3], double rotation[9], struct sh_err *err)
{
    int rc = locate_check(place, err);
    if (rc == SH_OK) shim_ecef(place->lat_deg, place->lon_deg, place->height_m, p_ecef, rotation);
    return rc;
}

int locate_in_grid(const struct georef_place *place, int zone, struct locate_grid *out, struct sh_err *err)
{
    char why[256] = "", name[32];
    int rc = locate_check(place, err);
    if (rc != SH_OK) return rc;
    snprintf(name, sizeof name, zone == GEOREF_UPS ? "UPS" : "UTM zone %d", zone);
    if (zone >= GEOREF_UPS && zone <= 60 && shim_grid_at(place, zone, out, why, sizeof why) == 0) return SH_OK;
    return sh_fail(err, SH_EINPUT, "%s does not reach latitude %.10g, longitude %.10g%s%s%s", name, place->lat_deg,
                   place->lon_deg, why[0] != '\0' ? " (" : "", why, why[0] != '\0' ? ")" : "");
}

int georef_locate_utm(int zone, int north, const double grid_m[3], struct georef_place *out, struct sh_err *err)
{
    char why[256] = "";
    if (zone < 0 || zone > 60) return sh_fail(err, SH_EINPUT, "UTM zone %d; allowed 1 to 60, or 0: UPS", zone);
    if (!isfinite(grid_m[0]) || !isfinite(grid_m[1]) || !isfinite(grid_m[2]))
        return sh_fail(err, SH_EINPUT, "%s coordinates are not finite numbers of metres", zone == 0 ? "UPS" : "UTM");
    if (shim_locate_utm(zone, north, grid_m, out, why, sizeof why) != 0) {
        char name[32];
        snprintf(name, sizeof name, zone == 0 ? "UPS " : "UTM zone %d", zone);
        return sh_fail(err, SH_EINPUT, "%.3f E %.3f N is not in %s%c (%s)", grid_m[0], grid_m[1], name,
                       north ? 'N' : 'S', why);
    }
    out->height_m = grid_m[2];
    return SH_OK;
}

int georef_locate_ecef(const double p_ecef[3], struct georef_place *out, struct sh_err *err)
{
    double at[3];
    if (!isfinite(p_ecef[0]) || !isfinite(p_ecef[1]) || !isfinite(p_ecef[2]))
        return sh_fail(err, SH_EINPUT, "ECEF coordinates are not finite numbers of metres");
    shim_locate_ecef(p_ecef, at);
    if (!isfinite(at[0]))
        return sh_fail(err, SH_EINPUT, "ECEF %.3f %.3f %.3f has no latitude", p_ecef[0], p_ecef[1], p_ecef[2]);
    *out = (struct georef_place){at[0], at[1], at[2]};
    return SH_OK;
}

void georef_geodetic_to_ecef(const struct georef_place *place, double p_ecef[3])
{
    double rotation[9];
    shim_ecef(place->lat_deg, place->lon_deg, place->height_m, p_ecef, rotation);
}

int georef_geoid_open(struct georef_geoid **out, struct sh_err *err)
{
    char why[256] = "";
    *out = shim_geoid_open(why, sizeof why);
    if (*out != NULL) return SH_OK;
    return sh_fail(err, SH_EINPUT, "no geoid data (%s); geographiclib-get-geoids egm96-5 installs them", why);
}
