/* SPDX-License-Identifier: MIT */
#include "core/georef.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/angle.h"
#include "core/georef/geographiclib_shim.h"
#include "core/georef/state.h"
#include "core/locate.h"
#include "core/mat3.h"
#include "core/vec3.h"

/* Polynomials are fitted within FIT_MAX_M. Where longitude is one of their outputs, the limit is FIT_OF_AXIS of the
 * distance from the Earth's axis, since the series of longitude converges only within that distance. Below FIT_LEAST_M
 * there are no polynomials. */
#define FIT_MAX_M   20000.0
#define FIT_OF_AXIS (1.0 / 64.0)
#define FIT_LEAST_M 1.0
/* A centre nearer to the axis than this is at the pole, and has no longitude. */
#define AXIS_LEAST_M 1.0

static int check_spec(const struct georef_spec *spec, struct sh_err *err)
{
    for (int i = 0; i < 3; i++)
        if (!isfinite(spec->station_m[i]))
            return sh_fail(err, SH_EINPUT, "georef: station position %c is not a finite number of metres", "xyz"[i]);
    if ((int)spec->crs < GEOREF_LOCAL || spec->crs > GEOREF_GEODETIC)
        return sh_fail(err, SH_EINPUT, "georef: coordinate reference system %d; allowed local, ecef, utm, geodetic",
                       (int)spec->crs);
    if (spec->crs == GEOREF_LOCAL) return SH_OK;
    int rc = locate_check(&(struct georef_place){spec->lat_deg, spec->lon_deg, spec->height_m}, err);
    if (rc == SH_OK && spec->crs == GEOREF_UTM && (spec->utm_zone < GEOREF_UPS || spec->utm_zone > 60))
        rc = sh_fail(err, SH_EINPUT, "georef: UTM zone %d; allowed 1 to 60, or 0: by position", spec->utm_zone);
    return rc;
}

/* Refuses a matrix that differs from a rotation by more than rounding. */
static int check_rotation(const double r[9], struct sh_err *err)
{
    for (int i = 0; i < 9; i++) {
        int row = i / 3, other = i % 3;
        double dot = vec3_dot(r + 3 * row, r + 3 * other);
        if (!(fabs(dot - (row == other)) <= 1e-9))
            return sh_fail(err, SH_EINPUT, "georef: the scene frame's matrix is not a rotation");
    }
    return SH_OK;
}

/* Checks how the scene frame lies, and puts the unit matrix in the place of a rotation of zeros. */
static int set_up_frame(struct georef_spec *spec, struct sh_err *err)
{
    static const double none[9];
    if (spec->crs == GEOREF_LOCAL) return SH_OK;
    if (!spec->prcs_is_grid) {
        if (memcmp(spec->rotation, none, sizeof none) == 0) memcpy(spec->rotation, mat3_unit, sizeof none);
        return check_rotation(spec->rotation, err);
    }
    if (spec->prcs_zone >= 0 && spec->prcs_zone <= 60) return SH_OK;
    return sh_fail(err, SH_EINPUT, "georef: zone %d of the scene frame; allowed 1 to 60, or 0: UPS", spec->prcs_zone);
}

/* Whether the output's grid is the one that the scene is in. */
static int is_same_grid(const struct georef_spec *spec)
{
    return spec->crs == GEOREF_UTM && spec->prcs_is_grid &&
           (spec->utm_zone == 0 || spec->utm_zone == (spec->prcs_zone == 0 ? GEOREF_UPS : spec->prcs_zone)) &&
           (spec->side == 0 || (spec->side > 0) == spec->prcs_north) && spec->geoid == NULL;
}

/* Sets metres per degree of latitude and of longitude at the centre, and the distance from the axis. *lat_m is an upper
 * bound for places up to height_m above the centre: the meridian's radius of curvature is largest at the poles,
 * a^2/b. */
void georef_degrees(const struct georef *georef, double height_m, double *lat_m, double *lon_m, double *axis_m)
{
    double place[3], p[3], rotation[9];
    shim_map_place(georef->map, place);
    shim_ecef(place[0], place[1], place[2], p, rotation);
    *axis_m = hypot(p[0], p[1]);
    *lat_m = angle_rad(6399593.626 + fmax(place[2], 0.0) + height_m);
    *lon_m = angle_rad(*axis_m);
}

/* Sets what depends on the centre: anchor and polynomial. */
static void set_up_centre(struct georef *georef)
{
    struct shim_meridian meridian;
    enum polynomial_form form = georef->from_grid && georef->crs != GEOREF_ECEF ? POLYNOMIAL_FLAT : POLYNOMIAL_SPACE;
    double half_m = FIT_MAX_M, lat_m, lon_m, axis_m;
    shim_map_anchor(georef->map, georef->anchor);
    if (georef->crs == GEOREF_GEODETIC) {
        georef_degrees(georef, 0.0, &lat_m, &lon_m, &axis_m);
        if (shim_map_meridian(georef->map, &meridian)) form = POLYNOMIAL_MERIDIAN;
        if (form == POLYNOMIAL_FLAT || axis_m < AXIS_LEAST_M) half_m = fmin(half_m, FIT_OF_AXIS * axis_m);
    }
    georef->polynomial.half_m = 0.0;
    if (!georef->has_geoid && half_m >= FIT_LEAST_M) polynomial_fit(georef->map, form, half_m, &georef->polynomial);
}

static int fail_map(const struct georef_spec *spec, const char *why, struct sh_err *err)
{
    char name[32] = "UPS";
    if (spec->utm_zone != GEOREF_UPS) snprintf(name, sizeof name, "UTM zone %d", spec->utm_zone);
    if (spec->prcs_is_grid)
        return sh_fail(err, SH_EINPUT,
                       "georef: the grid of the scene or of the output does not reach latitude %g, longitude %g (%s)",
                       spec->lat_deg, spec->lon_deg, why);
    if (spec->crs == GEOREF_UTM)
        return sh_fail(err, SH_EINPUT, "georef: %s does not reach latitude %g, longitude %g (%s)%s", name,
                       spec->lat_deg, spec->lon_deg, why, spec->utm_zone > 0 ? "; zone 0: by position" : "");
    return sh_fail(err, SH_EINPUT, "georef: %s", why);
}

static int set_up_map(struct georef *georef, const struct georef_spec *spec, struct sh_err *err)
{
    char why[256] = "";
    georef->map = shim_map_create(spec, why, sizeof why);
    if (georef->map == NULL) return fail_map(spec, why, err);
    georef->has_geoid = spec->geoid != NULL;
    georef->from_grid = spec->prcs_is_grid;
    georef->epsg = shim_map_epsg(georef->map);
    set_up_centre(georef);
    return SH_OK;
}

/* Sets up the cases without a map: local, ECEF from a metric frame, and a grid that the scene is in. */
static void set_up_linear(struct georef *georef, const struct georef_spec *spec)
{
    memcpy(georef->anchor, spec->station_m, sizeof georef->anchor);
    memcpy(georef->rotation, mat3_unit, sizeof georef->rotation);
    if (spec->crs == GEOREF_UTM)
        georef->epsg = spec->prcs_zone == 0 ? (spec->prcs_north ? 32661 : 32761)
                                            : (spec->prcs_north ? 32600 : 32700) + spec->prcs_zone;
    if (spec->crs == GEOREF_ECEF) {
        double enu[9];
        shim_ecef(spec->lat_deg, spec->lon_deg, spec->height_m, georef->anchor, enu);
        mat3_multiply(enu, spec->rotation, georef->rotation);
        georef->epsg = 4978;
    }
    memcpy(georef->origin, georef->anchor, sizeof georef->origin);
}

int georef_create(const struct georef_spec *given, struct georef **out, struct sh_err *err)
{
    struct georef_spec spec = *given;
    int rc = check_spec(&spec, err);
    if (rc == SH_OK) rc = set_up_frame(&spec, err);
    if (rc != SH_OK) return rc;
    struct georef *georef = calloc(1, sizeof *georef);
    if (georef == NULL) return sh_fail(err, SH_ENOMEM, "georef: no memory");
    georef->crs = spec.crs;
    georef->method = GEOREF_EXACT;
    memcpy(georef->station_m, spec.station_m, sizeof georef->station_m);
    memcpy(georef->centre_m, spec.station_m, sizeof georef->centre_m);
    if (spec.crs == GEOREF_LOCAL || is_same_grid(&spec) || (spec.crs == GEOREF_ECEF && !spec.prcs_is_grid))
        set_up_linear(georef, &spec);
    else
        rc = set_up_map(georef, &spec, err);
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
    shim_map_free(georef->map);
    free(georef);
}

int georef_recentre(const struct georef *georef, const double centre_m[3], struct georef **out, struct sh_err *err)
{
    double d[3];
    char why[256] = "";
    for (int i = 0; i < 3; i++) {
        d[i] = centre_m[i] - georef->centre_m[i];
        if (!isfinite(d[i])) return sh_fail(err, SH_EINPUT, "georef: centre %c is not a finite number", "xyz"[i]);
    }
    struct georef *moved = malloc(sizeof *moved);
    if (moved == NULL) return sh_fail(err, SH_ENOMEM, "georef: no memory");
    *moved = *georef;
    memcpy(moved->centre_m, centre_m, sizeof moved->centre_m);
    if (georef_has_map(moved)) {
        moved->map = shim_map_recentre(georef->map, d, why, sizeof why);
        if (moved->map == NULL) {
            free(moved);
            return sh_fail(err, SH_EINPUT, "georef: the zone (EPSG %d) does not reach %.0f %.0f %.0f m (%s)",
                           georef->epsg, centre_m[0], centre_m[1], centre_m[2], why);
        }
        set_up_centre(moved);
    } else {
        double turned[3];
        vec3_sub(centre_m, georef->station_m, d);
        mat3_apply(georef->rotation, d, turned);
        vec3_add(georef->origin, turned, moved->anchor);
    }
    if (moved->method != GEOREF_EXACT && moved->polynomial.half_m == 0.0 && georef_has_map(moved)) {
        georef_free(moved);
        return sh_fail(err, SH_EINPUT, "georef: no polynomial about %.0f %.0f %.0f m: the place is too close to a pole",
                       centre_m[0], centre_m[1], centre_m[2]);
    }
    *out = moved;
    return SH_OK;
}

void georef_anchor(const struct georef *georef, double anchor[3])
{
    memcpy(anchor, georef->anchor, sizeof georef->anchor);
}

int georef_epsg(const struct georef *georef)
{
    return georef->epsg;
}

enum georef_crs georef_crs(const struct georef *georef)
{
    return georef->crs;
}

int georef_has_geoid(const struct georef *georef)
{
    return georef->has_geoid;
}

enum georef_method georef_method(const struct georef *georef)
{
    return georef->method;
}

void georef_convergence(const struct georef *georef, double *convergence_rad, double *scale)
{
    *convergence_rad = 0.0;
    *scale = 1.0;
    if (!georef_has_map(georef)) return;
    shim_map_convergence(georef->map, convergence_rad, scale);
    *convergence_rad = angle_rad(*convergence_rad);
}

int georef_rotation(const struct georef *georef, double rotation[9])
{
    if (georef_has_map(georef)) return 0;
    memcpy(rotation, georef->rotation, sizeof georef->rotation);
    return 1;
}

static int order_of(enum georef_method method)
{
    return method == GEOREF_ORDER5 ? 5 : 1 + (int)method - (int)GEOREF_ORDER1;
}

int georef_set_method(struct georef *georef, enum georef_method method, struct sh_err *err)
{
    if (method < GEOREF_EXACT || method > GEOREF_ORDER5)
        return sh_fail(err, SH_EINPUT, "georef: method %d; allowed exact, order1, order2, order3, order5", (int)method);
    if (method != GEOREF_EXACT && georef_has_map(georef) && georef->polynomial.half_m == 0.0)
        return sh_fail(err, SH_EINPUT, "georef: there is no polynomial %s; allowed exact",
                       georef->has_geoid ? "for heights above the geoid" : "about a place so close to a pole");
    if (method != GEOREF_EXACT && georef_has_map(georef) &&
        !polynomial_has_order(&georef->polynomial, order_of(method)))
        return sh_fail(err, SH_EINPUT, "georef: no polynomial of order %d here; allowed exact, order1, order2, order3",
                       order_of(method));
    georef->method = method;
    return SH_OK;
}

/* These two limits bound the rounding of positions of 6.4e6 to 1e7 m and, for maps, the error of GeographicLib, which
 * states 5 nm for transverse Mercator. */
#define EXACT_LINEAR_M 5e-9
#define EXACT_MAP_M    2e-8

double georef_bound_m(const struct georef *georef, enum georef_method method, double radius_m, double height_m)
{
    if (!(radius_m >= 0.0 && height_m >= 0.0)) return (double)INFINITY;
    if (!georef_has_map(georef))
        return georef->crs == GEOREF_ECEF ? EXACT_LINEAR_M + 4e-16 * (radius_m + height_m) : 0.0;
    if (method == GEOREF_EXACT) return EXACT_MAP_M;
    if (method == GEOREF_AUTO) return (double)INFINITY;
    double weight[3] = {1.0, 1.0, 1.0}, axis_m;
    if (georef->crs == GEOREF_GEODETIC) {
        georef_degrees(georef, height_m, &weight[0], &weight[1], &axis_m);
        weight[1] *= 1.0 + (radius_m + height_m) / axis_m;
    }
    return EXACT_MAP_M + polynomial_bound_m(&georef->polynomial, order_of(method), radius_m, height_m, weight);
}

static void rotate(const double r[9], size_t n, struct vec3_in d, struct vec3_out out)
{
    for (size_t i = 0; i < n; i++) {
        const double x = d.x[i], y = d.y[i], z = d.z[i];
        out.x[i] = r[0] * x + r[1] * y + r[2] * z;
        out.y[i] = r[3] * x + r[4] * y + r[5] * z;
        out.z[i] = r[6] * x + r[7] * y + r[8] * z;
    }
}

void georef_forward(const struct georef *georef, size_t n, struct vec3_in d, struct vec3_out out)
{
    if (georef_has_map(georef)) {
        if (georef->method == GEOREF_EXACT)
            shim_map_forward(georef->map, n, d, out);
        else
            polynomial_apply(&georef->polynomial, order_of(georef->method), n, d, out);
    } else if (georef->crs == GEOREF_ECEF) {
        rotate(georef->rotation, n, d, out);
    } else {
        memmove(out.x, d.x, n * sizeof *out.x);
        memmove(out.y, d.y, n * sizeof *out.y);
        memmove(out.z, d.z, n * sizeof *out.z);
    }
}

void georef_reverse(const struct georef *georef, const double d_crs[3], double p_prcs[3])
{
    double d[3];
    if (georef_has_map(georef))
        shim_map_reverse(georef->map, d_crs, d);
    else
        mat3_apply_transposed(georef->rotation, d_crs, d);
    vec3_add(georef->centre_m, d, p_prcs);
}

void georef_difference(const struct georef *georef, const double p_crs[3], double d_crs[3])
{
    vec3_sub(p_crs, georef->anchor, d_crs);
    if (georef->crs == GEOREF_GEODETIC) d_crs[1] = remainder(d_crs[1], 360.0);
}
