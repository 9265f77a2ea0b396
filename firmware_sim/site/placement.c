/* SPDX-License-Identifier: MIT */
#include "firmware_sim/site/placement.h"

#include <math.h>
#include <string.h>

#include "core/angle.h"
#include "core/cast.h"
#include "core/crs.h"
#include "core/ifc_site.h"
#include "core/locate.h"
#include "core/mat3.h"
#include "core/text.h"
#include "firmware_sim/config/config.h"
#include "firmware_sim/config/places.h"
#include "firmware_sim/site/steps.h"

/* A floor at the place that was given, or this little above it, is still found. */
#define FLOOR_ABOVE_M 0.01

double placement_apart_m(const struct georef_place *a, const struct georef_place *b)
{
    double p[3], q[3];
    georef_geodetic_to_ecef(a, p);
    georef_geodetic_to_ecef(b, q);
    return hypot(hypot(p[0] - q[0], p[1] - q[1]), p[2] - q[2]);
}

/* Finds the one IFC mesh. The mesh's coordinate frame must be the scene's except for a shift. */
static int find_ifc(const struct config *cfg, const struct config_mesh **out, struct sh_err *err)
{
    *out = NULL;
    for (uint32_t i = 0; i < cfg->scene.n_meshes; i++) {
        const struct config_mesh *mesh = &cfg->scene.mesh[i];
        if (!text_has_ending(mesh->file, ".ifc")) continue;
        if (*out != NULL)
            return sh_fail(err, SH_EINPUT, "%s: scene.anchor: source ifc, but there are two IFC meshes; allowed one",
                           cfg->file);
        if (mesh->up != SCENE_UP_Y || mesh->scale != 1.0)
            return sh_fail(err, SH_EINPUT,
                           "%s: scene.anchor: source ifc needs the IFC mesh in its own axes and metres; allowed up: y, "
                           "scale: 1",
                           cfg->file);
        *out = mesh;
    }
    if (*out != NULL) return SH_OK;
    return sh_fail(err, SH_EINPUT, "%s: scene.anchor: source ifc, but no mesh is an .ifc file", cfg->file);
}

/* Returns the height of a model above the ellipsoid: that of the configuration, else height_m of the file. Files give
 * heights above sea level. Such heights are taken without a conversion, with a warning. height_m NaN: the file has no
 * height, and 0 is returned. */
static double ifc_height(const struct config *cfg, const struct sh_report *report, const char *file, const char *what,
                         double height_m)
{
    if (cfg->scene.anchor.height_given) return cfg->scene.anchor.height_m;
    if (isnan(height_m))
        sh_warn(report, "%s: no %s: 0 m above the ellipsoid is assumed; scene.anchor.height_m can set that height",
                file, what);
    else
        sh_warn(
            report,
            "%s: %s counts from sea level, but is taken as height above the ellipsoid; scene.anchor.height_m can set "
            "that height",
            file, what);
    return isnan(height_m) ? 0.0 : height_m;
}

/* Two places that a model gives may be this far apart without a warning. IfcSite is often the town's place. */
#define SITE_FROM_MAP_M 10000.0

static void compare_site(const struct sh_report *report, const char *file, const struct ifc_site *site,
                         const struct crs_place *map)
{
    if (!site->has_place) return;
    const double apart_m = placement_apart_m(&(struct georef_place){site->lat_deg, site->lon_deg, 0.0},
                                             &(struct georef_place){map->at.lat_deg, map->at.lon_deg, 0.0});
    if (apart_m > SITE_FROM_MAP_M)
        sh_warn(report,
                "%s: its IFCSITE is %.0f km from the place that its IFCMAPCONVERSION gives; the map conversion is used",
                file, 1e-3 * apart_m);
}

/* The model's origin is at the map conversion's place, and its x axis lies in the grid, which is turned from true
 * north. */
static int anchor_by_map(const struct config *cfg, const struct sh_report *report, const struct config_mesh *mesh,
                         const struct ifc_site *site, struct geoframe *frame, struct sh_err *err)
{
    const struct ifc_map *map = &site->map;
    struct crs_place place;
    struct sh_err why = {0};
    const double height_m = ifc_height(cfg, report, mesh->file, "OrthogonalHeight", map->height_m);
    int rc = crs_locate(map->crs, map->easting_m, map->northing_m, height_m, &place, &why);
    if (rc != SH_OK) return sh_fail(err, rc, "%s: IFCMAPCONVERSION: %s", mesh->file, why.text);
    compare_site(report, mesh->file, site, &place);
    if (place.accuracy_m > 0.1)
        sh_warn(report, "%s: %s has errors up to %.2g m on WGS 84", mesh->file, map->crs, place.accuracy_m);
    return geoframe_set_tangent(frame, mesh->offset_m, &place.at, angle_deg(map->x_axis_rad - place.convergence_rad),
                                err);
}

static int anchor_by_ifc(const struct config *cfg, const struct sh_report *report, struct geoframe *frame,
                         struct sh_err *err)
{
    const struct config_mesh *mesh;
    struct ifc_site site;
    int rc = find_ifc(cfg, &mesh, err);
    if (rc == SH_OK) rc = ifc_site_read(mesh->file, &site, err);
    if (rc != SH_OK) return rc;
    if (site.has_map) return anchor_by_map(cfg, report, mesh, &site, frame, err);
    double origin_m[3];
    for (int i = 0; i < 3; i++)
        origin_m[i] = site.origin_m[i] + mesh->offset_m[i];
    const struct georef_place at = {site.lat_deg, site.lon_deg,
                                    ifc_height(cfg, report, mesh->file, "RefElevation", site.elevation_m)};
    return geoframe_set_tangent(frame, origin_m, &at, site.north_deg, err);
}

int placement_find_anchor(const struct config *cfg, const struct sh_report *report, struct placement_anchor *anchor,
                          struct sh_err *err)
{
    const struct config_anchor *a = &cfg->scene.anchor;
    const struct georef_place at = {a->lat_deg, a->lon_deg, a->height_m};
    memset(anchor, 0, sizeof *anchor);
    anchor->known = a->source != ANCHOR_NONE;
    switch (a->source) {
    case ANCHOR_EXPLICIT:
        return geoframe_set_tangent(&anchor->frame, a->origin_m, &at, a->north_deg, err);
    case ANCHOR_IFC:
        return anchor_by_ifc(cfg, report, &anchor->frame, err);
    case ANCHOR_GEOTIFF:
        return anchor_by_geotiff(cfg, report, &anchor->frame, err);
    case ANCHOR_UTM:
        return geoframe_set_grid(&anchor->frame, (int)a->utm_zone, a->north, err);
    case ANCHOR_ECEF:
        geoframe_set_ecef(&anchor->frame);
        break;
    case ANCHOR_NONE:
        break;
    }
    return SH_OK;
}

/* Finds the place on the Earth that the configuration gives. */
static int given_place(const struct config_station *s, struct georef_place *at, struct sh_err *err)
{
    int rc = SH_OK;
    *at = (struct georef_place){s->lat_deg, s->lon_deg, s->height_m};
    if (s->place == PLACE_UTM)
        rc = georef_locate_utm((int)s->utm_zone, s->north, (const double[3]){s->easting_m, s->northing_m, s->height_m},
                               at, err);
    if (s->place == PLACE_ECEF) rc = georef_locate_ecef(s->ecef_m, at, err);
    return rc == SH_OK ? locate_check(at, err) : rc;
}

/* Finds the position in the scene. A UTM place in a scene of the same grid, and an ECEF place in a scene in ECEF, are
 * taken over to the last bit. */
static int find_position(const struct config_station *s, const struct geoframe *frame, const struct georef_place *at,
                         double position_m[3], struct sh_err *err)
{
    if (frame->kind == GEOFRAME_ECEF && s->place == PLACE_ECEF) {
        memcpy(position_m, s->ecef_m, sizeof s->ecef_m);
        return SH_OK;
    }
    if (frame->kind == GEOFRAME_GRID && s->place == PLACE_UTM && (int)s->utm_zone == frame->zone &&
        s->north == frame->north) {
        const double p[3] = {s->easting_m, s->northing_m, s->height_m};
        memcpy(position_m, p, sizeof p);
        return SH_OK;
    }
    return geoframe_find(frame, at, position_m, err);
}

/* Goes from the given place down to the floor, and up by the instrument's height. */
static int stand_on_floor(const struct config_station *s, const double level[9], const struct bvh *bvh,
                          struct placement *out, struct sh_err *err)
{
    const double up[3] = {level[2], level[5], level[8]}, down[3] = {-up[0], -up[1], -up[2]};
    double from_m[3];
    for (int i = 0; i < 3; i++)
        from_m[i] = out->position_m[i] + FLOOR_ABOVE_M * up[i];
    const double range_m = bvh_ray(bvh, from_m, down);
    if (isnan(range_m))
        return sh_fail(err, SH_EINPUT,
                       "instrument_height_m, but no surface of the scene lies below %.10g %.10g %.10g m; give a place "
                       "above the floor, or no instrument_height_m",
                       out->position_m[0], out->position_m[1], out->position_m[2]);
    out->floor_m = s->instrument_height_m;
    for (int i = 0; i < 3; i++)
        out->position_m[i] = from_m[i] + (s->instrument_height_m - range_m) * up[i];
    return SH_OK;
}

int placement_level(const struct placement_anchor *anchor, const double at_m[3], double level[9], struct sh_err *err)
{
    memcpy(level, mat3_unit, sizeof mat3_unit);
    return anchor->known ? geoframe_level(&anchor->frame, at_m, level, err) : SH_OK;
}

static int site_placement_find(const struct config_station *s, const struct placement_anchor *anchor,
                               const struct bvh *bvh, struct placement *out, struct sh_err *err)
{
    struct georef_place at;
    double level[9], attitude[9];
    int rc = given_place(s, &at, err);
    memcpy(out->position_m, s->position_m, sizeof out->position_m);
    if (rc == SH_OK && !s->has_position) rc = find_position(s, &anchor->frame, &at, out->position_m, err);
    if (rc == SH_OK) rc = placement_level(anchor, out->position_m, level, err);
    if (rc == SH_OK && s->has_instrument_height) rc = stand_on_floor(s, level, bvh, out, err);
    if (rc == SH_OK && anchor->known) rc = geoframe_locate(&anchor->frame, out->position_m, &at, err);
    if (!anchor->known && s->place != PLACE_NONE)
        at.height_m += out->position_m[2] - s->position_m[2]; /* as far as stand_on_floor moved it */
    if (rc != SH_OK) return rc;
    out->on_earth = anchor->known || s->place != PLACE_NONE;
    out->place = at;
    pose_attitude(angle_rad(s->heading_deg), angle_rad(s->pitch_deg), angle_rad(s->roll_deg), attitude);
    mat3_multiply(level, attitude, out->rotation);
    return SH_OK;
}

int placement_find(const struct config *cfg, uint32_t i, const struct placement_anchor *anchor, const struct bvh *bvh,
                   struct placement *out, struct sh_err *err)
{
    struct sh_err why = {0, ""};
    *out = (struct placement){.floor_m = NAN};
    int rc = site_placement_find(&cfg->station[i], anchor, bvh, out, &why);
    if (rc == SH_OK) return SH_OK;
    return sh_fail(err, rc, "%s: stations[%u] (%s): %.300s", cfg->file, i, cfg->station[i].name, why.text);
}

int placement_georef(const struct placement *placement, const struct placement_anchor *anchor, struct georef_spec *spec,
                     struct sh_err *err)
{
    if (anchor->known) return geoframe_fill(&anchor->frame, placement->position_m, spec, err);
    memcpy(spec->station_m, placement->position_m, sizeof spec->station_m);
    spec->lat_deg = placement->place.lat_deg;
    spec->lon_deg = placement->place.lon_deg;
    spec->height_m = placement->place.height_m;
    return SH_OK;
}
