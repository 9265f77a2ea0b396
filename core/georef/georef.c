#include "core/georef.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/georef/geographiclib_shim.h"
#include "core/mat3.h"
#include "core/vec3.h"

/* Lowest land and sea bed to the edge of space: beyond, a unit or a sign is wrong. */
#define HEIGHT_MIN_M (-12000.0)
#define HEIGHT_MAX_M 100000.0

struct georef {
    enum georef_crs crs;
    double station_m[3];
    double anchor[3];
    double rotation[9]; /* ecef: east, north, up -> X, Y, Z, row by row */
    struct shim_grid *grid;
    /* prcs -> east, north, up at the station comes first: nothing, a rotation, or out of a grid */
    enum { PRCS_TANGENT, PRCS_TURNED, PRCS_GRID, PRCS_IS_CRS } prcs;
    double turn[9];
    struct shim_grid *prcs_grid;
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

/* What differs from a unit matrix is wrong by more than rounding. */
static int check_rotation(const double r[9], struct sh_err *err)
{
    for (int i = 0; i < 9; i++) {
        int row = i / 3, other = i % 3;
        double dot = vec3_dot(r + 3 * row, r + 3 * other);
        if (!(fabs(dot - (row == other)) <= 1e-9))
            return sh_fail(err, SH_EINPUT, "georef: the rotation of the scene frame is none");
    }
    return SH_OK;
}

static int set_up_grid_prcs(struct georef *georef, const struct georef_spec *spec, struct sh_err *err)
{
    char why[256] = "";
    if (spec->prcs_zone < 0 || spec->prcs_zone > 60)
        return sh_fail(err, SH_EINPUT, "georef: zone %d of the scene frame; allowed 1 to 60, or 0: UPS",
                       spec->prcs_zone);
    int epsg = spec->prcs_zone == 0 ? (spec->prcs_north ? 32661 : 32761)
                                    : (spec->prcs_north ? 32600 : 32700) + spec->prcs_zone;
    if (spec->crs == GEOREF_UTM && (spec->utm_zone == 0 || spec->utm_zone == spec->prcs_zone)) {
        georef->prcs = PRCS_IS_CRS;
        memcpy(georef->anchor, spec->station_m, sizeof georef->anchor);
        georef->epsg = epsg;
        return SH_OK;
    }
    georef->prcs = PRCS_GRID;
    georef->prcs_grid =
        shim_grid_create(spec->lat_deg, spec->lon_deg, spec->height_m, spec->prcs_zone, why, sizeof why);
    int ups = georef->prcs_grid != NULL && shim_grid_epsg(georef->prcs_grid) % 100 == 61;
    if (georef->prcs_grid != NULL && ups == (spec->prcs_zone == 0)) return SH_OK;
    return sh_fail(err, SH_EINPUT, "georef: the scene's grid does not reach latitude %g, longitude %g%s%s%s",
                   spec->lat_deg, spec->lon_deg, why[0] != '\0' ? " (" : "", why, why[0] != '\0' ? ")" : "");
}

static int set_up_prcs(struct georef *georef, const struct georef_spec *spec, struct sh_err *err)
{
    static const double none[9];
    if (spec->crs == GEOREF_LOCAL) return SH_OK;
    if (spec->prcs_is_grid) return set_up_grid_prcs(georef, spec, err);
    if (memcmp(spec->rotation, none, sizeof none) == 0) return SH_OK;
    georef->prcs = PRCS_TURNED;
    memcpy(georef->turn, spec->rotation, sizeof georef->turn);
    return check_rotation(georef->turn, err);
}

static void set_up_ecef(struct georef *georef, const struct georef_spec *spec)
{
    double enu[9];
    shim_ecef(spec->lat_deg, spec->lon_deg, spec->height_m, georef->anchor, enu);
    memcpy(georef->rotation, enu, sizeof enu);
    if (georef->prcs == PRCS_TURNED) {
        mat3_multiply(enu, georef->turn, georef->rotation);
        georef->prcs = PRCS_TANGENT; /* it is part of the rotation now */
    }
    georef->epsg = 4978;
}

int georef_create(const struct georef_spec *spec, struct georef **out, struct sh_err *err)
{
    int rc = check_spec(spec, err);
    if (rc != SH_OK) return rc;
    struct georef *georef = calloc(1, sizeof *georef);
    if (georef == NULL) return sh_fail(err, SH_ENOMEM, "georef: no memory");
    georef->crs = spec->crs;
    memcpy(georef->station_m, spec->station_m, sizeof georef->station_m);
    rc = set_up_prcs(georef, spec, err);
    switch (rc == SH_OK ? spec->crs : GEOREF_LOCAL) {
    case GEOREF_LOCAL:
        memcpy(georef->anchor, spec->station_m, sizeof georef->anchor);
        break;
    case GEOREF_ECEF:
        set_up_ecef(georef, spec);
        break;
    case GEOREF_UTM:
        if (georef->prcs != PRCS_IS_CRS) rc = set_up_utm(georef, spec, err);
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
    shim_grid_free(georef->prcs_grid);
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
    if (georef->prcs == PRCS_GRID || (georef->crs == GEOREF_UTM && georef->prcs != PRCS_IS_CRS)) return 0;
    memcpy(rotation, georef->crs == GEOREF_ECEF ? georef->rotation : mat3_unit, sizeof mat3_unit);
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
    if (georef->prcs == PRCS_TURNED || georef->prcs == PRCS_GRID) {
        if (georef->prcs == PRCS_TURNED)
            rotate(georef->turn, n, dx, dy, dz, out_x, out_y, out_z);
        else
            shim_grid_to_local(georef->prcs_grid, n, dx, dy, dz, out_x, out_y, out_z);
        dx = out_x;
        dy = out_y;
        dz = out_z;
    }
    switch (georef->prcs == PRCS_IS_CRS ? GEOREF_LOCAL : georef->crs) {
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
    double enu[3] = {d_crs[0], d_crs[1], d_crs[2]}, d[3];
    if (georef->crs == GEOREF_UTM && georef->prcs != PRCS_IS_CRS)
        shim_grid_reverse(georef->grid, d_crs, enu);
    else if (georef->crs == GEOREF_ECEF)
        mat3_apply_transposed(georef->rotation, d_crs, enu);
    memcpy(d, enu, sizeof d);
    if (georef->prcs == PRCS_TURNED) mat3_apply_transposed(georef->turn, enu, d);
    if (georef->prcs == PRCS_GRID) shim_grid_forward(georef->prcs_grid, 1, &d[0], &d[1], &d[2], &d[0], &d[1], &d[2]);
    for (int i = 0; i < 3; i++)
        p_prcs[i] = georef->station_m[i] + d[i];
}
