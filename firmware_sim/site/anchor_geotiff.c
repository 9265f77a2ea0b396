/* SPDX-License-Identifier: MIT */
#include "firmware_sim/site/steps.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "core/angle.h"
#include "core/crs.h"
#include "core/geotiff.h"
#include "firmware_sim/config/config.h"
#include "firmware_sim/config/places.h"

/* Two libraries agree on the same projection to nanometres; other grids differ by metres. */
#define SAME_GRID_M 1e-3
/* An error of the tangent frame gets a warning from this value on. */
#define CORNER_M 0.01

/* The scene's rasters, as one. */
struct terrain {
    const char *file; /* of the first */
    char crs[sizeof((struct geotiff *)0)->crs];
    double bounds_m[4]; /* low easting, low northing, high ones */
    const double *offset_m;
    int above_ellipsoid; /* the heights of all of them */
};

static const char *named(const char *crs)
{
    return crs[0] != '\0' ? crs : "not in the EPSG registry";
}

static int add_raster(const struct config *cfg, const struct config_mesh *mesh, struct terrain *t, struct sh_err *err)
{
    struct geotiff g;
    double bounds_m[4];
    if (mesh->up != SCENE_UP_Z || mesh->scale != 1.0)
        return sh_fail(
            err, SH_EINPUT,
            "%s: scene.anchor: source geotiff needs the GeoTIFF mesh as it is, z up and in metres; allowed up: z, "
            "scale: 1",
            cfg->file);
    int rc = geotiff_read(mesh->file, &g, err);
    if (rc != SH_OK) return rc;
    geotiff_bounds(&g, bounds_m);
    if (t->file == NULL) {
        *t = (struct terrain){.file = mesh->file, .offset_m = mesh->offset_m, .above_ellipsoid = 1};
        memcpy(t->crs, g.crs, sizeof t->crs);
        memcpy(t->bounds_m, bounds_m, sizeof t->bounds_m);
    }
    if (strcmp(g.crs, t->crs) != 0)
        return sh_fail(
            err, SH_EINPUT,
            "%s: scene.anchor: source geotiff, but the system of %s is %s, and that of %s is %s; allowed is one "
            "system for all",
            cfg->file, t->file, named(t->crs), mesh->file, named(g.crs));
    if (memcmp(mesh->offset_m, t->offset_m, sizeof mesh->offset_m) != 0)
        return sh_fail(err, SH_EINPUT,
                       "%s: scene.anchor: source geotiff, but %s and %s differ in offset_m; allowed is one for both",
                       cfg->file, t->file, mesh->file);
    t->above_ellipsoid &= g.above_ellipsoid;
    for (int k = 0; k < 2; k++) {
        t->bounds_m[k] = fmin(t->bounds_m[k], bounds_m[k]);
        t->bounds_m[k + 2] = fmax(t->bounds_m[k + 2], bounds_m[k + 2]);
    }
    return SH_OK;
}

static int find_terrain(const struct config *cfg, struct terrain *t, struct sh_err *err)
{
    int rc = SH_OK;
    t->file = NULL;
    for (uint32_t i = 0; i < cfg->scene.n_meshes && rc == SH_OK; i++)
        if (geotiff_is_name(cfg->scene.mesh[i].file)) rc = add_raster(cfg, &cfg->scene.mesh[i], t, err);
    if (rc != SH_OK) return rc;
    if (t->file == NULL)
        return sh_fail(err, SH_EINPUT, "%s: scene.anchor: source geotiff, but no mesh is a .tif file", cfg->file);
    if (t->crs[0] != '\0') return SH_OK;
    return sh_fail(
        err, SH_EINPUT,
        "%s: its system has no EPSG code, so its place on the Earth is unknown; allowed: gdal_edit.py -a_srs "
        "EPSG:CODE, gdalwarp -t_srs EPSG:CODE -dstnodata -9999, or a scene.anchor of another source",
        t->file);
}

/* Finds the UTM zone, and its hemisphere, in which the place `at` has the coordinates grid_m. Returns 0: none. */
static int find_zone(const double grid_m[3], const struct georef_place *at, int *north)
{
    for (int zone = 1; zone <= 60; zone++) {
        for (*north = 0; *north < 2; ++*north) {
            struct georef_place utm;
            struct sh_err why;
            if (georef_locate_utm(zone, *north, grid_m, &utm, &why) == SH_OK &&
                placement_apart_m(&utm, at) < SAME_GRID_M)
                return zone;
        }
    }
    return 0;
}

/* Finds the largest distance of a corner, at the raster's height 0, from its place in the raster's own system. */
static int measure_corners(const struct terrain *t, const struct geoframe *frame, double height_m, double *worst_m,
                           struct sh_err *err)
{
    *worst_m = 0.0;
    for (int i = 0; i < 4; i++) {
        const double e = t->bounds_m[i % 2 * 2], n = t->bounds_m[i / 2 * 2 + 1];
        const double p[3] = {e + t->offset_m[0], n + t->offset_m[1], t->offset_m[2]};
        struct crs_place want;
        struct georef_place got;
        int rc = crs_locate(t->crs, e, n, height_m, &want, err);
        if (rc == SH_OK) rc = geoframe_locate(frame, p, &got, err);
        if (rc != SH_OK) return rc;
        *worst_m = fmax(*worst_m, placement_apart_m(&got, &want.at));
    }
    return SH_OK;
}

static void anchor_geotiff_say(const struct config *cfg, const struct sh_report *report, const struct terrain *t,
                               const struct crs_place *at)
{
    if (!cfg->scene.anchor.height_given && !t->above_ellipsoid)
        sh_warn(report,
                "%s: its heights, which mostly count from sea level, are taken as heights above the ellipsoid; "
                "scene.anchor.height_m sets the height of the raster's 0 above the ellipsoid",
                t->file);
    if (at->accuracy_m > 0.1)
        sh_warn(report, "%s: coordinates in %s have errors up to %.2g m on WGS 84", t->file, t->crs, at->accuracy_m);
}

/* Sets *worst_m to the farthest that a corner is from its place. */
static int set_tangent(const struct terrain *t, const double middle_m[2], const struct crs_place *at,
                       struct geoframe *frame, double *worst_m, struct sh_err *err)
{
    const double *o = t->offset_m, origin_m[3] = {middle_m[0] + o[0], middle_m[1] + o[1], o[2]};
    int rc = geoframe_set_tangent(frame, origin_m, &at->at, -angle_deg(at->convergence_rad), err);
    return rc == SH_OK ? measure_corners(t, frame, at->at.height_m, worst_m, err) : rc;
}

static void say_corners(const struct sh_report *report, const struct terrain *t, const struct crs_place *at, int is_utm,
                        double worst_m)
{
    char exact[112];
    if (worst_m < CORNER_M) return;
    if (is_utm)
        snprintf(exact, sizeof exact, "offset_m: [0, 0, %.10g]", at->at.height_m);
    else
        snprintf(exact, sizeof exact, "a raster in UTM: gdalwarp -t_srs EPSG:%d -r bilinear -dstnodata -9999",
                 geotiff_utm_code(at->at.lat_deg, at->at.lon_deg));
    sh_warn(report,
            "%s: the scene is tangent to the Earth at its middle, so the corners are wrong by up to %.2g m in %s; for "
            "exact places use %s",
            t->file, worst_m, t->crs, exact);
}

int anchor_by_geotiff(const struct config *cfg, const struct sh_report *report, struct geoframe *frame,
                      struct sh_err *err)
{
    struct terrain t;
    struct crs_place at;
    struct sh_err why = {0};
    const double height_m = cfg->scene.anchor.height_given ? cfg->scene.anchor.height_m : 0.0;
    int rc = find_terrain(cfg, &t, err), north = 0;
    if (rc != SH_OK) return rc;
    const double middle_m[3] = {0.5 * (t.bounds_m[0] + t.bounds_m[2]), 0.5 * (t.bounds_m[1] + t.bounds_m[3]), height_m};
    rc = crs_locate(t.crs, middle_m[0], middle_m[1], height_m, &at, &why);
    if (rc != SH_OK) return sh_fail(err, rc, "%s: %s", t.file, why.text);
    anchor_geotiff_say(cfg, report, &t, &at);
    const int zone = find_zone(middle_m, &at.at, &north);
    if (zone > 0 && t.offset_m[0] == 0.0 && t.offset_m[1] == 0.0 && t.offset_m[2] == height_m)
        return geoframe_set_grid(frame, zone, north, err);
    double worst_m = 0.0;
    rc = set_tangent(&t, middle_m, &at, frame, &worst_m, err);
    if (rc == SH_OK) say_corners(report, &t, &at, zone > 0, worst_m);
    return rc;
}
