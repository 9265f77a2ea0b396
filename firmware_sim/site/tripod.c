/* SPDX-License-Identifier: MIT */
/* Tripods: the opening of their legs, from the head's height above the ground; the directions that they hide; their
 * legs as a mesh.
 *
 * The ground is the first surface straight below the head's origin, without movers. The vertical is the plumb line
 * there (placement.c), however the head is tilted. A leg of length L reaches from the top, at height h above that
 * ground, down to its level: cos(opening) = h / L. */
#include "firmware_sim/site/steps.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/angle.h"
#include "core/mat3.h"
#include "firmware_sim/config/config.h"

/* Each leg is a prism with SIDES side faces and two ends. */
enum { LEGS = 3, SIDES = 6, LEG_VERTICES = 2 * SIDES, LEG_TRIANGLES = 2 * SIDES + 2 * (SIDES - 2) };

/* Returns the number of the configured station that a stop is at: stops go through all stations, round after round
 * (platform.c). */
static uint32_t number_of(const struct site *site, uint32_t i)
{
    return i % site->cfg->n_stations;
}

static const struct config_tripod *given(const struct site *site, uint32_t i)
{
    const struct config_tripod *t = &site->cfg->station[number_of(site, i)].tripod;
    return t->given ? t : NULL;
}

int site_name_legs(struct site *site, struct sh_err *err)
{
    const struct config *cfg = site->cfg;
    int legs = 0;
    for (uint32_t i = 0; i < cfg->n_stations; i++)
        legs |= cfg->station[i].tripod.given && cfg->station[i].tripod.legs;
    if (!legs) return SH_OK;
    if (site->n_surfaces == SCENE_MAX_SURFACES)
        return sh_fail(err, SH_EINPUT, "%s: too many surfaces to add one for tripods' legs; allowed are %d", cfg->file,
                       SCENE_MAX_SURFACES);
    site->legs = calloc(1, sizeof *site->legs);
    if (site->legs == NULL) return sh_fail(err, SH_ENOMEM, "no memory for the legs of tripods");
    *site->legs = (struct scene_surface){"tripod", "leg", {0.5f, 0.5f, 0.5f}, .has_colour = 1};
    site->legs_label = site->n_surfaces++;
    return SH_OK;
}

/* ---- height and opening */

static int open_legs(const struct site *site, struct site_station *s, uint32_t i, struct sh_err *err)
{
    struct site_tripod *t = &s->tripod;
    const double least_rad = angle_rad(t->from->opening_min_deg);
    t->height_m = t->head_m - t->from->head_above_m;
    t->opening_rad = least_rad;
    if (isnan(t->head_m)) return SH_OK;
    if (!(t->height_m > 0.0))
        return sh_fail(
            err, SH_EINPUT,
            "%s: stations[%u] (%s): tripod.head_above_m: %.6g m, but the head is %.6g m above the ground; allowed is "
            "less than that",
            site->cfg->file, number_of(site, i), s->station->name, t->from->head_above_m, t->head_m);
    t->gap_m = t->height_m - t->from->leg_m * cos(least_rad);
    if (t->gap_m > 0.0) return SH_OK;
    t->gap_m = 0.0;
    t->opening_rad = acos(t->height_m / t->from->leg_m);
    return SH_OK;
}

static void tripod_warn(const struct site_station *s, uint32_t i, const struct sh_report *report)
{
    const struct site_tripod *t = &s->tripod;
    if (isnan(t->head_m))
        sh_warn(report,
                "station %u %s: tripod: there is no ground below it, so its legs have their smallest opening, %g deg",
                i + 1, s->station->name, t->from->opening_min_deg);
    else if (t->gap_m > 0.0)
        sh_warn(
            report,
            "station %u %s: tripod: it hovers: its top is %.6g m above the ground, and legs of %g m reach down %.6g m "
            "at their smallest opening, %g deg: %.6g m are missing",
            i + 1, s->station->name, t->height_m, t->from->leg_m, t->height_m - t->gap_m, t->from->opening_min_deg,
            t->gap_m);
}

void site_describe_tripod(const struct site_station *s, char *text, size_t len)
{
    const struct site_tripod *t = &s->tripod;
    const int cone = t->cast.cos_opening < 1.0;
    char height[80] = "no ground below", hole[80] = "";
    if (!isnan(t->head_m))
        snprintf(height, sizeof height, "top %.6g m above the ground%s", t->height_m,
                 t->gap_m > 0.0 ? ", hovering" : "");
    if (cone && !isnan(t->head_m))
        snprintf(hole, sizeof hole, ", which hides %.6g m around on level ground", t->head_m * tan(t->opening_rad));
    snprintf(text, len, "legs of %g m%s, %s; opening %.6g deg%s%s", t->from->leg_m, t->cast.has_legs ? " in view" : "",
             height, angle_deg(t->opening_rad), cone ? hole : "; no cone",
             cone && t->cast.has_legs ? ", besides the legs" : "");
}

/* ---- legs */

/* A leg's mesh leaves out this share of the leg at the top. Otherwise a head at the top would be inside all legs. */
static const double LEG_BEGINS = 0.1;

/* Makes a prism along the leg, from LEG_BEGINS of the leg's length to its end. */
static void fill_leg(const struct site_tripod *t, const double top_m[3], const double level[9], int leg,
                     double (*vertex_m)[3])
{
    const double azimuth = angle_rad(t->from->legs_heading_deg + 360.0 / LEGS * leg);
    const double s = sin(t->opening_rad), c = cos(t->opening_rad), radius_m = 0.5 * t->from->leg_diameter_m;
    double axis[3], across[3], outward[3];
    for (int k = 0; k < 3; k++) {
        const double *row = level + 3 * k;
        const double away = sin(azimuth) * row[0] + cos(azimuth) * row[1];
        axis[k] = s * away - c * row[2];
        outward[k] = c * away + s * row[2];
        across[k] = cos(azimuth) * row[0] - sin(azimuth) * row[1];
    }
    for (int i = 0; i < LEG_VERTICES; i++) {
        const double turn = 2.0 * M_PI * (i % SIDES) / SIDES;
        const double along_m = t->from->leg_m * (i < SIDES ? LEG_BEGINS : 1.0);
        for (int k = 0; k < 3; k++)
            vertex_m[i][k] = top_m[k] + along_m * axis[k] + radius_m * (cos(turn) * across[k] + sin(turn) * outward[k]);
    }
}

static void fill_triangles(uint32_t first, uint32_t (*triangle)[3])
{
    int n = 0;
    for (uint32_t i = 0; i < SIDES; i++) {
        const uint32_t a = first + i, b = first + (i + 1) % SIDES;
        memcpy(triangle[n++], (const uint32_t[3]){a, b, b + SIDES}, sizeof *triangle);
        memcpy(triangle[n++], (const uint32_t[3]){a, b + SIDES, a + SIDES}, sizeof *triangle);
    }
    for (uint32_t i = 1; i + 1 < SIDES; i++) {
        memcpy(triangle[n++], (const uint32_t[3]){first, first + i + 1, first + i}, sizeof *triangle);
        memcpy(triangle[n++], (const uint32_t[3]){first + SIDES, first + SIDES + i, first + SIDES + i + 1},
               sizeof *triangle);
    }
}

static int make_legs(const struct site *site, struct site_station *s, const double level[9],
                     const struct sh_report *report, struct sh_err *err)
{
    struct site_tripod *t = &s->tripod;
    double vertex_m[LEGS * LEG_VERTICES][3], top_m[3];
    uint32_t triangle[LEGS * LEG_TRIANGLES][3];
    for (int k = 0; k < 3; k++)
        top_m[k] = s->at.position_m[k] - t->from->head_above_m * level[3 * k + 2];
    for (int leg = 0; leg < LEGS; leg++) {
        fill_leg(t, top_m, level, leg, vertex_m + leg * LEG_VERTICES);
        fill_triangles((uint32_t)(leg * LEG_VERTICES), triangle + leg * LEG_TRIANGLES);
    }
    const struct scene_arrays arrays = {(const double(*)[3])vertex_m,
                                        LEGS * LEG_VERTICES,
                                        (const uint32_t(*)[3])triangle,
                                        LEGS * LEG_TRIANGLES,
                                        NULL,
                                        site->legs,
                                        1};
    int rc = scene_from_arrays(&arrays, &t->legs, err);
    if (rc != SH_OK) return rc;
    for (uint32_t i = 0; i < t->legs->n_triangles; i++)
        t->legs->label[i] = (uint16_t)site->legs_label;
    t->legs->label0 = site->legs_label;
    t->cast.has_legs = 1;
    rc = bvh_create(t->legs, site->cfg->loop.threads, report, &t->bvh, err);
    if (rc != SH_OK) return rc;
    t->cast.legs.radius_m = site_enclose(t->legs, t->cast.legs.centre_m);
    memcpy(t->cast.legs.rotation, mat3_unit, sizeof mat3_unit);
    t->cast.legs.bvh = t->bvh;
    return SH_OK;
}

static int tripod_set_up(const struct site *site, struct site_station *s, uint32_t i, const struct sh_report *report,
                         struct sh_err *err)
{
    struct site_tripod *t = &s->tripod;
    double level[9];
    int rc = placement_level(&site->anchor, s->at.position_m, level, err);
    if (rc != SH_OK) return rc;
    for (int k = 0; k < 3; k++)
        t->cast.down[k] = -level[3 * k + 2];
    t->head_m = bvh_ray(site->bvh, s->at.position_m, t->cast.down);
    rc = open_legs(site, s, i, err);
    if (rc != SH_OK) return rc;
    const int cone = t->from->cone == CHOICE_ON || (t->from->cone == CHOICE_AUTO && !t->from->legs);
    t->cast.cos_opening = cone ? cos(t->opening_rad) : 2.0;
    tripod_warn(s, i, report);
    return t->from->legs ? make_legs(site, s, level, report, err) : SH_OK;
}

int site_set_up_tripods(struct site *site, const struct sh_report *report, struct sh_err *err)
{
    int rc = SH_OK;
    for (uint32_t i = 0; i < site->n_stations && rc == SH_OK; i++) {
        struct site_station *s = &site->station[i];
        if (config_serves(site->cfg, i)) s->tripod.from = given(site, i);
        if (s->tripod.from == NULL) continue;
        rc = tripod_set_up(site, s, i, report, err);
        if (rc == SH_OK) rc = sh_check_stop(report, err);
    }
    return rc;
}

int site_tripod_at(const struct site *site, uint32_t station, const double position_m[3], struct site_tripod *out,
                   struct sh_err *err)
{
    struct site_station s;
    memcpy(&s, &site->station[station], sizeof s);
    memcpy(s.at.position_m, position_m, sizeof s.at.position_m);
    s.tripod = (struct site_tripod){.from = s.tripod.from};
    *out = s.tripod;
    if (s.tripod.from == NULL) return SH_OK;
    int rc = tripod_set_up(site, &s, station, NULL, err);
    *out = s.tripod;
    return rc;
}

void site_free_tripod(struct site_tripod *t)
{
    bvh_free(t->bvh);
    scene_free(t->legs);
}
