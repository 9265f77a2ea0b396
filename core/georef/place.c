/* Places on WGS 84 from and to other systems, one at a time. */
#include <math.h>

#include "core/georef.h"
#include "core/georef/geographiclib_shim.h"

int georef_locate_utm(int zone, int north, double easting_m, double northing_m, double height_m,
                      struct georef_place *out, struct sh_err *err)
{
    const double grid[2] = {easting_m, northing_m};
    double at[2];
    char why[256] = "";
    if (zone < 0 || zone > 60) return sh_fail(err, SH_EINPUT, "UTM zone %d; allowed 1 to 60, or 0: UPS", zone);
    if (!isfinite(easting_m) || !isfinite(northing_m) || !isfinite(height_m))
        return sh_fail(err, SH_EINPUT, "%s coordinates are not finite numbers of metres", zone == 0 ? "UPS" : "UTM");
    if (shim_locate_utm(zone, north, grid, at, why, sizeof why) != 0)
        return sh_fail(err, SH_EINPUT, "%.3f E %.3f N is not in %s %d%c (%s)", easting_m, northing_m,
                       zone == 0 ? "UPS" : "UTM zone", zone, north ? 'N' : 'S', why);
    *out = (struct georef_place){at[0], at[1], height_m};
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

int georef_geodetic_to_utm(const struct georef_place *place, int zone, int *zone_used, int *north, double grid[3],
                           struct sh_err *err)
{
    const double at[2] = {place->lat_deg, place->lon_deg};
    int is_north;
    char why[256] = "";
    if (zone < 0 || zone > 60) return sh_fail(err, SH_EINPUT, "UTM zone %d; allowed 1 to 60, or 0: by position", zone);
    if (!isfinite(at[0]) || !isfinite(at[1]) || shim_to_utm(at, &zone, &is_north, grid, why, sizeof why) != 0)
        return sh_fail(err, SH_EINPUT, "UTM zone %d does not reach latitude %g, longitude %g (%s)", zone, at[0], at[1],
                       why);
    grid[2] = place->height_m;
    if (zone_used != NULL) *zone_used = zone;
    if (north != NULL) *north = is_north;
    return SH_OK;
}
