#include "core/crs.h"

#include <math.h>
#include <proj.h>

#include "core/angle.h"

/* The name as the user's file has it; the kind must be projected, since a head needs metres. */
static int check_kind(PJ_CONTEXT *context, const char *name, struct sh_err *err)
{
    PJ *crs = proj_create(context, name), *flat = NULL;
    PJ_TYPE kind = crs != NULL ? proj_get_type(crs) : PJ_TYPE_UNKNOWN;
    if (kind == PJ_TYPE_COMPOUND_CRS) {
        flat = proj_crs_get_sub_crs(context, crs, 0);
        kind = flat != NULL ? proj_get_type(flat) : PJ_TYPE_UNKNOWN;
    }
    const int known = crs != NULL;
    proj_destroy(flat);
    proj_destroy(crs);
    if (kind == PJ_TYPE_PROJECTED_CRS) return SH_OK;
    return sh_fail(err, SH_EINPUT, "%s: %s; allowed is a projected system, as EPSG:25832 is", name,
                   known ? "not a projected coordinate reference system" : "no such coordinate reference system");
}

/* Longitude and latitude in degrees, in this order, whatever the order of the systems' own axes. */
static PJ *open_transformation(PJ_CONTEXT *context, const char *name)
{
    PJ *raw = proj_create_crs_to_crs(context, name, "EPSG:4326", NULL);
    PJ *to = raw != NULL ? proj_normalize_for_visualization(context, raw) : NULL;
    proj_destroy(raw);
    return to;
}

/* By differences over 100 m each way: what they leave out is of the third order, below 1e-9 in any grid of survey. */
static void measure_grid(PJ *to, double easting_m, double northing_m, const PJ_COORD *at, struct crs_place *place)
{
    static const double step_m = 100.0, a_m = 6378137.0, e2 = 0.00669437999014;
    const PJ_COORD south = proj_trans(to, PJ_FWD, proj_coord(easting_m, northing_m - step_m, 0.0, 0.0));
    const PJ_COORD north = proj_trans(to, PJ_FWD, proj_coord(easting_m, northing_m + step_m, 0.0, 0.0));
    const double lat = angle_rad(at->xy.y), w = sqrt(1.0 - e2 * sin(lat) * sin(lat));
    const double east_m = angle_rad(remainder(north.xy.x - south.xy.x, 360.0)) * a_m / w * cos(lat);
    const double north_m = angle_rad(north.xy.y - south.xy.y) * a_m * (1.0 - e2) / (w * w * w);
    place->convergence_rad = atan2(east_m, north_m);
    place->scale = 2.0 * step_m / hypot(east_m, north_m);
}

static int locate(PJ *to, const char *name, double easting_m, double northing_m, struct crs_place *place,
                  struct sh_err *err)
{
    const PJ_COORD at = proj_trans(to, PJ_FWD, proj_coord(easting_m, northing_m, 0.0, 0.0));
    if (!(fabs(at.xy.x) <= 180.0 && fabs(at.xy.y) <= 90.0))
        return sh_fail(err, SH_EINPUT, "%s: easting %.10g, northing %.10g m are outside of it", name, easting_m,
                       northing_m);
    place->at.lon_deg = at.xy.x;
    place->at.lat_deg = at.xy.y;
    measure_grid(to, easting_m, northing_m, &at, place);
    PJ *used = proj_trans_get_last_used_operation(to);
    const double accuracy_m = used != NULL ? proj_pj_info(used).accuracy : -1.0;
    proj_destroy(used);
    place->accuracy_m = accuracy_m >= 0.0 ? accuracy_m : NAN;
    return SH_OK;
}

int crs_locate(const char *name, double easting_m, double northing_m, double height_m, struct crs_place *place,
               struct sh_err *err)
{
    *place = (struct crs_place){.at.height_m = height_m, .accuracy_m = NAN};
    PJ_CONTEXT *context = proj_context_create();
    if (context == NULL) return sh_fail(err, SH_ENOMEM, "no memory for PROJ");
    proj_log_level(context, PJ_LOG_NONE);
    proj_context_set_enable_network(context, 0);
    int rc = check_kind(context, name, err);
    PJ *to = rc == SH_OK ? open_transformation(context, name) : NULL;
    if (rc == SH_OK && to == NULL) rc = sh_fail(err, SH_EINPUT, "%s: PROJ knows no way from it to WGS 84", name);
    if (rc == SH_OK) rc = locate(to, name, easting_m, northing_m, place, err);
    proj_destroy(to);
    proj_context_destroy(context);
    return rc;
}
