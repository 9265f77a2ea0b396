/* Places on WGS 84 from and to other systems, one at a time. */
#include <math.h>

#include "core/georef.h"
#include "core/georef/geographiclib_shim.h"

int georef_locate_utm(int zone, int north, const double grid_m[3], struct georef_place *out, struct sh_err *err)
{
    double at[2];
    char why[256] = "";
    if (zone < 0 || zone > 60) return sh_fail(err, SH_EINPUT, "UTM zone %d; allowed 1 to 60, or 0: UPS", zone);
    if (!isfinite(grid_m[0]) || !isfinite(grid_m[1]) || !isfinite(grid_m[2]))
        return sh_fail(err, SH_EINPUT, "%s coordinates are not finite numbers of metres", zone == 0 ? "UPS" : "UTM");
    if (shim_locate_utm(zone, north, grid_m, at, why, sizeof why) != 0)
        return sh_fail(err, SH_EINPUT, "%.3f E %.3f N is not in %s %d%c (%s)", grid_m[0], grid_m[1],
                       zone == 0 ? "UPS" : "UTM zone", zone, north ? 'N' : 'S', why);
    *out = (struct georef_place){at[0], at[1], grid_m[2]};
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
