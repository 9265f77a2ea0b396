/* SPDX-License-Identifier: MIT */
#include "firmware_sim/app/check_places.h"

#include <math.h>
#include <string.h>

#include "core/angle.h"
#include "core/locate.h"
#include "core/mat3.h"
#include "core/vec3.h"
#include "firmware_sim/config/config.h"
#include "firmware_sim/config/places.h"

/* From 0 to below 360, and no -0. */
static double turn_deg(double deg)
{
    double turned = fmod(deg, 360.0) + 0.0;
    if (turned < 0.0) turned += 360.0;
    return turned < 360.0 - 5e-7 ? turned : 0.0; /* 359.9999995 and more would print as 360 */
}

void check_print_anchor(const struct site *site, FILE *out)
{
    const struct config *cfg = site->cfg;
    const struct geoframe *f = &site->anchor.frame;
    static const char *const source[] = {[ANCHOR_EXPLICIT] = "explicit",
                                         [ANCHOR_IFC] = "ifc",
                                         [ANCHOR_UTM] = "utm",
                                         [ANCHOR_ECEF] = "ecef",
                                         [ANCHOR_GEOTIFF] = "geotiff"};
    const int of_station = cfg->scene.anchor.source == ANCHOR_NONE;
    if (!site->anchor.known) {
        fputs("anchor    none: each station has a place of its own, with the scene's y axis as its true north\n", out);
        return;
    }
    fprintf(out, "anchor    %s: ", of_station ? "station 1 of the configuration" : source[cfg->scene.anchor.source]);
    if (of_station || f->kind == GEOFRAME_TANGENT)
        fprintf(out, "scene point %.4f %.4f %.4f at lat %.9f lon %.9f deg, height %.4f m; true north ", f->origin_m[0],
                f->origin_m[1], f->origin_m[2], f->lat_deg, f->lon_deg, f->height_m);
    if (of_station)
        fputs("along y\n", out);
    else if (f->kind == GEOFRAME_TANGENT)
        fprintf(out, "%.6f deg clockwise from y\n", f->north_deg + 0.0);
    else if (f->kind == GEOFRAME_ECEF)
        fputs("the scene's coordinates are ECEF\n", out);
    else if (f->zone == 0)
        fprintf(out, "the scene's coordinates are UPS %s\n", f->north ? "north" : "south");
    else
        fprintf(out, "the scene's coordinates are UTM %d %s\n", f->zone, f->north ? "north" : "south");
}

/* Unit vector of the head's axis k in east, north, up at the station. Returns 0 where it is not known. */
static int axis_enu(const struct site *site, uint32_t i, int k, double enu[3])
{
    const struct placement *at = &site->station[i].at;
    const double axis[3] = {at->rotation[k], at->rotation[3 + k], at->rotation[6 + k]};
    double to_enu[9];
    memcpy(to_enu, mat3_unit, sizeof to_enu);
    if (site->anchor.known && geoframe_to_enu(&site->anchor.frame, at->position_m, to_enu, NULL) != SH_OK) return 0;
    mat3_apply(to_enu, axis, enu);
    return 1;
}

static void print_utm(const struct locate_grid *utm, double height_m, FILE *out)
{
    if (utm->zone == 0)
        fprintf(out, "  ups       %s", utm->north ? "north" : "south");
    else
        fprintf(out, "  utm       %d %s", utm->zone, utm->north ? "north" : "south");
    fprintf(out, "  %.4f %.4f %.4f m; convergence %.6f deg, scale %.8f\n", utm->easting_m, utm->northing_m, height_m,
            utm->convergence_deg, utm->scale);
}

/* The error of a level range in a scene whose coordinates are a grid's. The error comes from the grid's scale and
 * from the height above the ellipsoid, and is taken from two points 100 grid metres apart. The line is left out at the
 * very edge of what the grid reaches, where one of the points is beyond it. */
static void print_grid_ranges(const struct site *site, const double p_prcs[3], FILE *out)
{
    double p_ecef[2][3];
    struct sh_err beyond;
    for (int i = 0; i < 2; i++) {
        const double p[3] = {p_prcs[0] + (i == 0 ? -50.0 : 50.0), p_prcs[1], p_prcs[2]};
        struct georef_place at;
        if (geoframe_locate(&site->anchor.frame, p, &at, &beyond) != SH_OK) return;
        georef_geodetic_to_ecef(&at, p_ecef[i]);
    }
    double error = 100.0 / vec3_distance(p_ecef[1], p_ecef[0]) - 1.0, range_m = site->cfg->profile.range_max_m;
    fprintf(out, "            ranges are grid lengths: a level one of %g m reads %+.4f m (%+.1f ppm)\n", range_m,
            range_m * error, 1e6 * error);
}

/* Finds the station in the grid of the output, with northings from the side of the equator that all points have. */
static int find_in_grid(const struct site *site, const struct placement *at, struct locate_grid *utm,
                        struct sh_err *why)
{
    int zone, side;
    site_grid(site, &zone, &side);
    const int rc = locate_in_grid(&at->place, zone, utm, why);
    if (rc == SH_OK && side != 0 && utm->zone != 0 && utm->north != (side > 0)) {
        utm->north = side > 0;
        utm->northing_m += utm->north ? -1e7 : 1e7;
    }
    return rc;
}

/* utm: NULL where the grid doesn't reach the station. */
static void print_axes(const struct site *site, uint32_t i, const struct locate_grid *utm, FILE *out)
{
    double forward[3], up[3];
    if (!axis_enu(site, i, 1, forward) || !axis_enu(site, i, 2, up)) {
        fputs("  y axis    its azimuth is not known\n", out); /* the scene's grid doesn't reach the station */
        return;
    }
    const double azimuth_deg = angle_deg(atan2(forward[0], forward[1]));
    fprintf(out, "  y axis    azimuth %.6f deg from true north", turn_deg(azimuth_deg));
    if (utm != NULL) fprintf(out, ", %.6f from grid north", turn_deg(azimuth_deg - utm->convergence_deg));
    fprintf(out, "; z axis %.6f deg off the plumb line\n", angle_deg(atan2(hypot(up[0], up[1]), up[2])));
}

/* A run needs none of these figures, so one that can't be given is no error: its line says why. */
static void print_on_earth(const struct site *site, uint32_t i, FILE *out)
{
    const struct placement *at = &site->station[i].at;
    const int is_grid = site->anchor.known && site->anchor.frame.kind == GEOFRAME_GRID;
    double p_ecef[3];
    struct locate_grid utm;
    struct sh_err why;
    const int is_in_grid = find_in_grid(site, at, &utm, &why) == SH_OK;
    georef_geodetic_to_ecef(&at->place, p_ecef);
    fprintf(out, "  geodetic  lat %.9f lon %.9f deg, height %.4f m\n", at->place.lat_deg, at->place.lon_deg,
            at->place.height_m);
    if (is_in_grid)
        print_utm(&utm, at->place.height_m, out);
    else
        fprintf(out, "  utm       none: %s\n", why.text);
    if (is_in_grid && is_grid) print_grid_ranges(site, at->position_m, out);
    fprintf(out, "  ecef      %.4f %.4f %.4f m\n", p_ecef[0], p_ecef[1], p_ecef[2]);
    print_axes(site, i, is_in_grid ? &utm : NULL, out);
}

static void print_tripod(const struct site_station *s, const char *before, FILE *out)
{
    char text[200];
    if (s->tripod.from == NULL) return;
    site_describe_tripod(s, text, sizeof text);
    fprintf(out, "%s%s", before, text);
}

void check_print_station(const struct site *site, uint32_t i, FILE *out)
{
    const struct site_station *s = &site->station[i];
    const struct config_station *c = s->station;
    double anchor[3];
    georef_anchor(s->georef, anchor);
    fprintf(out, "station %u %s, EPSG %d, anchor %.6f %.6f %.6f\n", i + 1, c->name, georef_epsg(s->georef), anchor[0],
            anchor[1], anchor[2]);
    fprintf(out, "  scene     %.4f %.4f %.4f m; heading %g, pitch %g, roll %g deg", s->at.position_m[0],
            s->at.position_m[1], s->at.position_m[2], c->heading_deg, c->pitch_deg, c->roll_deg);
    if (!isnan(s->at.floor_m)) fprintf(out, "; %g m above the floor", s->at.floor_m);
    print_tripod(s, "\n  tripod    ", out);
    fputc('\n', out);
    if (s->at.on_earth) print_on_earth(site, i, out);
}

void check_print_stops(const struct site *site, FILE *out)
{
    const struct config_platform *p = &site->cfg->platform;
    fprintf(out, "stops     %u, from %.9g s on, each %.9g s\n", site->n_stations, p->start_s, p->step_s);
    for (uint32_t i = 0; i < site->n_stations; i++) {
        const struct site_station *s = &site->station[i];
        const struct config_station *c = s->station;
        fprintf(out, "  %-9s %.9g s, frame %.9g, scene %.4f %.4f %.4f m; heading %g, pitch %g, roll %g deg", c->name,
                s->t_s, s->frame, s->at.position_m[0], s->at.position_m[1], s->at.position_m[2],
                turn_deg(c->heading_deg), c->pitch_deg + 0.0, c->roll_deg + 0.0);
        if (s->at.on_earth)
            fprintf(out, "; lat %.9f lon %.9f deg, height %.4f m", s->at.place.lat_deg, s->at.place.lon_deg,
                    s->at.place.height_m);
        print_tripod(s, "; tripod: ", out);
        fputc('\n', out);
    }
}
