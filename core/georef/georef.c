#include "core/georef.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/georef/geographiclib_shim.h"

/* Lowest land and sea bed to the edge of space: beyond, a unit or a sign is wrong. */
#define HEIGHT_MIN_M (-12000.0)
#define HEIGHT_MAX_M 100000.0

struct georef {
    enum georef_crs crs;
    double station_m[3];
    double anchor[3];
    double rotation[9]; /* ecef: east, north, up -> X, Y, Z, row by row */
    struct shim_grid *grid;
    int epsg;
};

static int check_range(const char *what, double value, double min, double max, const char *unit, struct sh_err *err)
{
    if (value >= min && value <= max) return SH_OK; /* false for not-a-number */
    return sh_fail(err, SH_EINPUT, "georef: %s %g %s; allowed %g to %g", what, value, unit, min, max);
}

static int check_spec(const struct georef_spec *spec, struct sh_err *err)
{
    for (int i = 0; i < 3; i++)
        if (!isfinite(spec->station_m[i]))
            return sh_fail(err, SH_EINPUT, "georef: station position %c is not a finite number of metres", "xyz"[i]);
    if (spec->crs == GEOREF_LOCAL) return SH_OK;
    int rc = check_range("latitude", spec->lat_deg, -90, 90, "deg", err);
    if (rc == SH_OK) rc = check_range("longitude", spec->lon_deg, -180, 360, "deg", err);
    if (rc == SH_OK) rc = check_range("height", spec->height_m, HEIGHT_MIN_M, HEIGHT_MAX_M, "m", err);
    if (rc == SH_OK && spec->crs == GEOREF_UTM && (spec->utm_zone < 0 || spec->utm_zone > 60))
        rc = sh_fail(err, SH_EINPUT, "georef: UTM zone %d; allowed 1 to 60, or 0: by position", spec->utm_zone);
    return rc;
}

static int set_up_utm(struct georef *georef, const struct georef_spec *spec, struct sh_err *err)
{
    char why[256] = "";
    georef->grid = shim_grid_create(spec->lat_deg, spec->lon_deg, spec->height_m, spec->utm_zone, why, sizeof why);
    if (georef->grid == NULL)
        return sh_fail(err, SH_EINPUT,
                       "georef: UTM zone %d does not reach latitude %g, longitude %g (%s); 0: by position",
                       spec->utm_zone, spec->lat_deg, spec->lon_deg, why);
    shim_grid_anchor(georef->grid, georef->anchor);
    georef->epsg = shim_grid_epsg(georef->grid);
    return SH_OK;
}

int georef_create(const struct georef_spec *spec, struct georef **out, struct sh_err *err)
{
    int rc = check_spec(spec, err);
    if (rc != SH_OK) return rc;
    struct georef *georef = calloc(1, sizeof *georef);
    if (georef == NULL) return sh_fail(err, SH_ENOMEM, "georef: no memory");
    georef->crs = spec->crs;
    memcpy(georef->station_m, spec->station_m, sizeof georef->station_m);
    switch (spec->crs) {
    case GEOREF_LOCAL:
        memcpy(georef->anchor, spec->station_m, sizeof georef->anchor);
        break;
    case GEOREF_ECEF:
        shim_ecef(spec->lat_deg, spec->lon_deg, spec->height_m, georef->anchor, georef->rotation);
        georef->epsg = 4978;
        break;
    case GEOREF_UTM:
        rc = set_up_utm(georef, spec, err);
        break;
    case GEOREF_GEODETIC:
    default:
        rc =
            sh_fail(err, SH_EINPUT, "georef: coordinate reference system %d; allowed local, ecef, utm", (int)spec->crs);
    }
    if (rc != SH_OK) {
        georef_free(georef);
        return rc;
    }
    *out = georef;
    return SH_OK;
}

void georef_free(struct georef *georef)
{
    if (georef == NULL) return;
    shim_grid_free(georef->grid);
    free(georef);
}

void georef_anchor(const struct georef *georef, double anchor[3])
{
    memcpy(anchor, georef->anchor, sizeof georef->anchor);
}

int georef_epsg(const struct georef *georef)
{
    return georef->epsg;
}

int georef_rotation(const struct georef *georef, double rotation[9])
{
    static const double same[9] = {1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0};
    if (georef->crs == GEOREF_UTM) return 0;
    memcpy(rotation, georef->crs == GEOREF_ECEF ? georef->rotation : same, sizeof same);
    return 1;
}

static void rotate(const double r[9], size_t n, const double *dx, const double *dy, const double *dz, double *out_x,
                   double *out_y, double *out_z)
{
    for (size_t i = 0; i < n; i++) {
        const double x = dx[i], y = dy[i], z = dz[i];
        out_x[i] = r[0] * x + r[1] * y + r[2] * z;
        out_y[i] = r[3] * x + r[4] * y + r[5] * z;
        out_z[i] = r[6] * x + r[7] * y + r[8] * z;
    }
}

void georef_forward(const struct georef *georef, size_t n, const double *dx, const double *dy, const double *dz,
                    double *out_x, double *out_y, double *out_z)
{
    switch (georef->crs) {
    case GEOREF_LOCAL:
        memmove(out_x, dx, n * sizeof *out_x);
        memmove(out_y, dy, n * sizeof *out_y);
        memmove(out_z, dz, n * sizeof *out_z);
        break;
    case GEOREF_ECEF:
        rotate(georef->rotation, n, dx, dy, dz, out_x, out_y, out_z);
        break;
    case GEOREF_GEODETIC:
    case GEOREF_UTM:
        shim_grid_forward(georef->grid, n, dx, dy, dz, out_x, out_y, out_z);
        break;
    }
}

void georef_reverse(const struct georef *georef, const double d_crs[3], double p_prcs[3])
{
    double d[3] = {d_crs[0], d_crs[1], d_crs[2]};
    if (georef->crs == GEOREF_UTM) {
        shim_grid_reverse(georef->grid, d_crs, d);
    } else if (georef->crs == GEOREF_ECEF) {
        const double *r = georef->rotation;
        for (int i = 0; i < 3; i++)
            d[i] = r[i] * d_crs[0] + r[i + 3] * d_crs[1] + r[i + 6] * d_crs[2];
    }
    for (int i = 0; i < 3; i++)
        p_prcs[i] = georef->station_m[i] + d[i];
}
