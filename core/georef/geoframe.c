/* SPDX-License-Identifier: MIT */
#include "core/geoframe.h"

#include <math.h>
#include <string.h>

#include "core/angle.h"
#include "core/locate.h"
#include "core/mat3.h"
#include "core/vec3.h"

int geoframe_set_tangent(struct geoframe *frame, const double origin_m[3], const struct georef_place *at,
                         double north_deg, struct sh_err *err)
{
    *frame = (struct geoframe){.kind = GEOFRAME_TANGENT,
                               .origin_m = {origin_m[0], origin_m[1], origin_m[2]},
                               .lat_deg = at->lat_deg,
                               .lon_deg = at->lon_deg,
                               .height_m = at->height_m,
                               .north_deg = north_deg};
    double enu[9], s = sin(angle_rad(north_deg)), c = cos(angle_rad(north_deg));
    /* North is (s, c) in the scene; east is a right angle clockwise from it. */
    const double turn[9] = {c, -s, 0.0, s, c, 0.0, 0.0, 0.0, 1.0};
    for (int i = 0; i < 3; i++)
        if (!isfinite(origin_m[i]) || !isfinite(north_deg))
            return sh_fail(err, SH_EINPUT, "the anchor's origin or direction is not a finite number");
    int rc = locate_axes(at, frame->ecef_m, enu, err);
    if (rc == SH_OK) mat3_multiply(enu, turn, frame->rotation);
    return rc;
}

int geoframe_set_grid(struct geoframe *frame, int zone, int north, struct sh_err *err)
{
    *frame = (struct geoframe){.kind = GEOFRAME_GRID, .zone = zone, .north = north};
    if (zone >= 0 && zone <= 60) return SH_OK;
    return sh_fail(err, SH_EINPUT, "UTM zone %d; allowed 1 to 60, or 0: UPS", zone);
}

void geoframe_set_ecef(struct geoframe *frame)
{
    *frame = (struct geoframe){.kind = GEOFRAME_ECEF};
}

static int locate(const struct geoframe *frame, const double p_prcs[3], struct georef_place *at, struct sh_err *err)
{
    double p_ecef[3], d[3];
    if (frame->kind == GEOFRAME_GRID) return georef_locate_utm(frame->zone, frame->north, p_prcs, at, err);
    memcpy(p_ecef, p_prcs, sizeof p_ecef);
    if (frame->kind == GEOFRAME_TANGENT) {
        vec3_sub(p_prcs, frame->origin_m, d);
        mat3_apply(frame->rotation, d, p_ecef);
        vec3_add(frame->ecef_m, p_ecef, p_ecef);
    }
    return georef_locate_ecef(p_ecef, at, err);
}

int geoframe_locate(const struct geoframe *frame, const double p_prcs[3], struct georef_place *at, struct sh_err *err)
{
    struct sh_err why = {0, ""};
    int rc = locate(frame, p_prcs, at, err);
    if (rc != SH_OK || locate_check(at, &why) == SH_OK) return rc;
    return sh_fail(err, SH_EINPUT, "scene point %.10g %.10g %.10g: %s", p_prcs[0], p_prcs[1], p_prcs[2], why.text);
}

/* The zone is forced; the northing counts from the frame's own side of the equator. */
static int find_in_grid(const struct geoframe *frame, const struct georef_place *at, double p_prcs[3],
                        struct sh_err *err)
{
    struct locate_grid utm;
    int rc = locate_in_grid(at, frame->zone == 0 ? GEOREF_UPS : frame->zone, &utm, err);
    if (rc != SH_OK) return rc;
    if (utm.zone != frame->zone || (utm.zone == 0 && utm.north != frame->north))
        return sh_fail(err, SH_EINPUT, "latitude %.10g, longitude %.10g is not in the scene's grid, UPS %s",
                       at->lat_deg, at->lon_deg, frame->north ? "north" : "south");
    p_prcs[0] = utm.easting_m;
    p_prcs[1] = utm.northing_m + (utm.zone == 0 ? 0.0 : 1e7 * (utm.north - frame->north));
    p_prcs[2] = at->height_m;
    return SH_OK;
}

int geoframe_find(const struct geoframe *frame, const struct georef_place *at, double p_prcs[3], struct sh_err *err)
{
    double p_ecef[3], d[3];
    if (frame->kind == GEOFRAME_GRID) return find_in_grid(frame, at, p_prcs, err);
    int rc = locate_check(at, err);
    if (rc != SH_OK) return rc;
    georef_geodetic_to_ecef(at, p_ecef);
    memcpy(p_prcs, p_ecef, sizeof p_ecef);
    if (frame->kind == GEOFRAME_ECEF) return SH_OK;
    vec3_sub(p_ecef, frame->ecef_m, d);
    mat3_apply_transposed(frame->rotation, d, p_prcs);
    vec3_add(frame->origin_m, p_prcs, p_prcs);
    return SH_OK;
}

int geoframe_level(const struct geoframe *frame, const double p_prcs[3], double rotation[9], struct sh_err *err)
{
    double to_enu[9];
    memcpy(rotation, mat3_unit, sizeof mat3_unit);
    if (frame->kind != GEOFRAME_ECEF) return SH_OK;
    int rc = geoframe_to_enu(frame, p_prcs, to_enu, err);
    if (rc == SH_OK) mat3_transpose(to_enu, rotation);
    return rc;
}

static int grid_to_enu(const struct geoframe *frame, const struct georef_place *at, double rotation[9],
                       struct sh_err *err)
{
    struct locate_grid utm;
    int rc = locate_in_grid(at, frame->zone == 0 ? GEOREF_UPS : frame->zone, &utm, err);
    if (rc != SH_OK) return rc;
    /* The bearing of grid north is the convergence, so grid north is (s, c) in east and north. */
    double s = sin(angle_rad(utm.convergence_deg)), c = cos(angle_rad(utm.convergence_deg));
    const double turn[9] = {c, s, 0.0, -s, c, 0.0, 0.0, 0.0, 1.0};
    memcpy(rotation, turn, sizeof turn);
    return SH_OK;
}

int geoframe_to_enu(const struct geoframe *frame, const double p_prcs[3], double rotation[9], struct sh_err *err)
{
    struct georef_place at;
    double p_ecef[3], enu[9], back[9];
    int rc = geoframe_locate(frame, p_prcs, &at, err);
    if (rc != SH_OK) return rc;
    if (frame->kind == GEOFRAME_GRID) return grid_to_enu(frame, &at, rotation, err);
    rc = locate_axes(&at, p_ecef, enu, err);
    if (rc != SH_OK) return rc;
    mat3_transpose(enu, back);
    mat3_multiply(back, frame->kind == GEOFRAME_TANGENT ? frame->rotation : mat3_unit, rotation);
    return SH_OK;
}

int geoframe_fill(const struct geoframe *frame, const double p_prcs[3], struct georef_spec *spec, struct sh_err *err)
{
    struct georef_place at;
    int rc = geoframe_locate(frame, p_prcs, &at, err);
    if (rc != SH_OK) return rc;
    memcpy(spec->station_m, p_prcs, sizeof spec->station_m);
    spec->lat_deg = at.lat_deg;
    spec->lon_deg = at.lon_deg;
    spec->height_m = at.height_m;
    if (frame->kind != GEOFRAME_GRID) return geoframe_to_enu(frame, p_prcs, spec->rotation, err);
    spec->prcs_is_grid = 1;
    spec->prcs_zone = frame->zone;
    spec->prcs_north = frame->north;
    return SH_OK;
}
