/* SPDX-License-Identifier: MIT */
#include "core/crs.h"

#include <math.h>
#include <string.h>

#include "core/angle.h"
#include "core/georef/proj_lib.h"
#include "core/vec3.h"

/* A coordinate reference system that PROJ knows: the part of it that is used here. */
struct grid {
    const char *name;
    struct proj_lib lib;
    PJ_CONTEXT *context;
    PJ *to;        /* transforms to longitude and latitude in degrees, in this order */
    double unit_m; /* of its axes */
    double west_deg, south_deg, east_deg, north_deg; /* where it is used; west NaN: not known */
};

static double axis_unit(const struct grid *grid, const PJ *crs)
{
    const struct proj_lib *lib = &grid->lib;
    PJ *axes = lib->proj_crs_get_coordinate_system(grid->context, crs);
    double unit_m = 1.0;
    if (axes != NULL) lib->proj_cs_get_axis_info(grid->context, axes, 0, NULL, NULL, NULL, &unit_m, NULL, NULL, NULL);
    lib->proj_destroy(axes);
    return unit_m > 0.0 ? unit_m : 1.0;
}

static void read_projected(struct grid *grid, const PJ *crs)
{
    grid->unit_m = axis_unit(grid, crs);
    if (!grid->lib.proj_get_area_of_use(grid->context, crs, &grid->west_deg, &grid->south_deg, &grid->east_deg,
                                        &grid->north_deg, NULL) ||
        grid->west_deg < -180.0)
        grid->west_deg = NAN;
}

/* The kind must be projected, since a head needs metres. */
static int read_system(struct grid *grid, struct sh_err *err)
{
    const struct proj_lib *lib = &grid->lib;
    PJ *crs = lib->proj_create(grid->context, grid->name);
    const int is_known = crs != NULL;
    if (is_known && lib->proj_get_type(crs) == PJ_TYPE_COMPOUND_CRS) {
        PJ *flat = lib->proj_crs_get_sub_crs(grid->context, crs, 0);
        lib->proj_destroy(crs);
        crs = flat;
    }
    const int is_projected = crs != NULL && lib->proj_get_type(crs) == PJ_TYPE_PROJECTED_CRS;
    if (is_projected) read_projected(grid, crs);
    lib->proj_destroy(crs);
    if (is_projected) return SH_OK;
    return sh_fail(err, SH_EINPUT, "%s: %s; allowed is a projected system such as EPSG:25832", grid->name,
                   is_known ? "not a projected coordinate reference system" : "no such coordinate reference system");
}

static int read_vertical(const struct grid *grid, double *unit_m, struct sh_err *err)
{
    const struct proj_lib *lib = &grid->lib;
    PJ *crs = lib->proj_create(grid->context, grid->name), *axes = NULL;
    const char *direction = "";
    if (crs != NULL && lib->proj_get_type(crs) == PJ_TYPE_VERTICAL_CRS)
        axes = lib->proj_crs_get_coordinate_system(grid->context, crs);
    const int is_up =
        axes != NULL &&
        lib->proj_cs_get_axis_info(grid->context, axes, 0, NULL, NULL, &direction, unit_m, NULL, NULL, NULL) &&
        strcmp(direction, "up") == 0;
    lib->proj_destroy(axes);
    lib->proj_destroy(crs);
    if (is_up) return SH_OK;
    return sh_fail(err, SH_EINPUT, "%s: not a vertical system with heights upward; allowed is one such as EPSG:5773",
                   grid->name);
}

static int open_transformation(struct grid *grid, struct sh_err *err)
{
    const struct proj_lib *lib = &grid->lib;
    PJ *raw = lib->proj_create_crs_to_crs(grid->context, grid->name, "EPSG:4326", NULL);
    grid->to = raw != NULL ? lib->proj_normalize_for_visualization(grid->context, raw) : NULL;
    lib->proj_destroy(raw);
    return grid->to != NULL ? SH_OK
                            : sh_fail(err, SH_EINPUT, "%s: PROJ has no transformation from it to WGS 84", grid->name);
}

static PJ_COORD transformed(const struct grid *grid, double easting_m, double northing_m)
{
    const PJ_COORD in = {.xyzt = {easting_m / grid->unit_m, northing_m / grid->unit_m, 0.0, 0.0}};
    return grid->lib.proj_trans(grid->to, PJ_FWD, in);
}

static void transformed_to_ecef(const struct grid *grid, double easting_m, double northing_m, double p_ecef[3])
{
    const PJ_COORD at = transformed(grid, easting_m, northing_m);
    georef_geodetic_to_ecef(&(struct georef_place){at.xy.y, at.xy.x, 0.0}, p_ecef);
}

/* Measures convergence and scale by differences over 100 m each way. The error of these differences is of the third
 * order, below 1e-9 in any survey grid. They are taken in space, since near a pole degrees change faster than the
 * grid. At the pole itself, north is that of the longitude in `at`. */
static void measure_grid(const struct grid *grid, double easting_m, double northing_m, const PJ_COORD *at,
                         struct crs_place *place)
{
    static const double step_m = 100.0;
    double south[3], north[3], d[3];
    transformed_to_ecef(grid, easting_m, northing_m - step_m, south);
    transformed_to_ecef(grid, easting_m, northing_m + step_m, north);
    vec3_sub(north, south, d);
    const double lat = angle_rad(at->xy.y), lon = angle_rad(at->xy.x);
    const double east_m = cos(lon) * d[1] - sin(lon) * d[0];
    const double north_m = cos(lat) * d[2] - sin(lat) * (cos(lon) * d[0] + sin(lon) * d[1]);
    place->convergence_rad = atan2(east_m, north_m);
    place->scale = 2.0 * step_m / hypot(east_m, north_m);
}

/* Areas of use are rough, and end at borders. A missing digit or a wrong unit gives a place farther away than this. */
#define AREA_MARGIN_DEG 2.0

static int is_within(const struct grid *grid, const PJ_COORD *at)
{
    if (!(fabs(at->xy.x) <= 180.0 && fabs(at->xy.y) <= 90.0)) return 0;
    if (isnan(grid->west_deg)) return 1;
    const double middle = 0.5 * (grid->west_deg + grid->east_deg) + (grid->east_deg < grid->west_deg ? 180.0 : 0.0);
    const double half = fabs(remainder(grid->east_deg - middle, 360.0));
    return fabs(remainder(at->xy.x - middle, 360.0)) <= half + AREA_MARGIN_DEG &&
           at->xy.y >= grid->south_deg - AREA_MARGIN_DEG && at->xy.y <= grid->north_deg + AREA_MARGIN_DEG;
}

static int locate(const struct grid *grid, double easting_m, double northing_m, struct crs_place *place,
                  struct sh_err *err)
{
    const PJ_COORD at = transformed(grid, easting_m, northing_m);
    if (!is_within(grid, &at))
        return sh_fail(err, SH_EINPUT, "%s: easting %.10g, northing %.10g m are outside of the system's area of use",
                       grid->name, easting_m, northing_m);
    place->at.lon_deg = at.xy.x;
    place->at.lat_deg = at.xy.y;
    measure_grid(grid, easting_m, northing_m, &at, place);
    PJ *used = grid->lib.proj_trans_get_last_used_operation(grid->to);
    const double accuracy_m = used != NULL ? grid->lib.proj_pj_info(used).accuracy : -1.0;
    grid->lib.proj_destroy(used);
    place->accuracy_m = accuracy_m >= 0.0 ? accuracy_m : NAN;
    return SH_OK;
}

/* Opens PROJ without messages on stderr, and without network. */
static int open_proj(struct grid *grid, struct sh_err *err)
{
    int rc = proj_lib_load(&grid->lib, err);
    if (rc != SH_OK) return rc;
    grid->context = grid->lib.proj_context_create();
    if (grid->context == NULL) return sh_fail(err, SH_ENOMEM, "no memory for PROJ");
    grid->lib.proj_log_level(grid->context, PJ_LOG_NONE);
    grid->lib.proj_context_set_enable_network(grid->context, 0);
    return SH_OK;
}

int crs_unit(const char *name, int is_vertical, double *unit_m, struct sh_err *err)
{
    struct grid grid = {.name = name};
    int rc = open_proj(&grid, err);
    if (rc != SH_OK) return rc;
    rc = is_vertical ? read_vertical(&grid, unit_m, err) : read_system(&grid, err);
    if (rc == SH_OK && !is_vertical) *unit_m = grid.unit_m;
    grid.lib.proj_context_destroy(grid.context);
    return rc;
}

int crs_locate(const char *name, double easting_m, double northing_m, double height_m, struct crs_place *place,
               struct sh_err *err)
{
    struct grid grid = {.name = name};
    *place = (struct crs_place){.at.height_m = height_m, .accuracy_m = NAN};
    int rc = open_proj(&grid, err);
    if (rc != SH_OK) return rc;
    rc = read_system(&grid, err);
    if (rc == SH_OK) rc = open_transformation(&grid, err);
    if (rc == SH_OK) rc = locate(&grid, easting_m, northing_m, place, err);
    grid.lib.proj_destroy(grid.to);
    grid.lib.proj_context_destroy(grid.context);
    return rc;
}
