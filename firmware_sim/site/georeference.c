/* SPDX-License-Identifier: MIT */
/* Georeferencing of a site: heights, method, counts. */
#include "core/digits.h"
#include "firmware_sim/config/config.h"
#include "firmware_sim/site/steps.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* Returns the largest distance of points from the place that they are relative to: a station, or the middle of a
 * stretch of the path. */
static double reach_m(const struct site *site, const struct site_stretch *stretch)
{
    double way_m = stretch != NULL ? stretch->reach_m : site->live_reach_m;
    return (site->cfg->profile.range_max_m + way_m) * SITE_MARGIN;
}

/* Sets how far points can lie from centre_m. Points are within the scene and within the head's range, with a margin of
 * a hundredth, and of ten sigma for noise. */
static void extent_from(const struct site *site, const double centre_m[3], double reach, struct plan_georef_need *need)
{
    double far[3], noise_m = site_noise_m(site);
    for (int i = 0; i < 3; i++) {
        double low = centre_m[i] - site->scene->min_m[i], high = site->scene->max_m[i] - centre_m[i];
        far[i] = fmax(low, high) * SITE_MARGIN + noise_m;
    }
    need->radius_m = need->height_m = reach;
    if (site->n_movers > 0) return;                                                 /* movers may go anywhere */
    if (site->detect.ghost != NULL || site->detect.cast.instrument != NULL) return; /* points outside of the scene */
    need->radius_m = fmin(reach, hypot(far[0], far[1]));
    need->height_m = fmin(reach, far[2]);
}

static int plan_one(const struct site *site, struct georef *georef, const double centre_m[3], double reach,
                    struct plan_row *row, struct sh_err *err)
{
    const struct config *cfg = site->cfg;
    struct plan_georef_need need = {.tolerance_m = cfg->output.tolerance_m, .forced = cfg->output.georef};
    enum georef_method method;
    struct sh_err why;
    extent_from(site, centre_m, reach, &need);
    int rc = plan_georef(georef, &need, &method, row, &why);
    if (rc != SH_OK) return sh_fail(err, rc, "%s: output.georef: %.300s", cfg->file, why.text);
    return georef_set_method(georef, method, err);
}

/* Gives each stretch of the path a georeference of its own about the stretch's middle. So counts and polynomials
 * need not reach further than a stretch, however long the path is. */
static int plan_stretches(const struct site *site, struct site_station *s, const struct sh_report *report,
                          struct sh_err *err)
{
    struct plan_row row;
    s->on_stretch = calloc(site->n_stretches, sizeof *s->on_stretch);
    if (s->on_stretch == NULL) return sh_fail(err, SH_ENOMEM, "no memory for the path");
    for (size_t i = 0; i < site->n_stretches; i++) {
        const struct site_stretch *stretch = &site->stretch[i];
        int rc = sh_check_stop(report, err);
        if (rc == SH_OK) rc = georef_recentre(s->georef, stretch->centre_m, &s->on_stretch[i].georef, err);
        if (rc == SH_OK)
            rc = plan_one(site, s->on_stretch[i].georef, stretch->centre_m, reach_m(site, stretch), &row, err);
        if (rc != SH_OK) return rc;
        if (i == 0 || row.cost_ns > s->plan.cost_ns ||
            (row.cost_ns == s->plan.cost_ns && row.error_m > s->plan.error_m))
            s->plan = row;
    }
    char why[sizeof row.why];
    snprintf(why, sizeof why, "path of %zu stretches, each about its middle: %.130s", site->n_stretches, s->plan.why);
    memcpy(s->plan.why, why, sizeof s->plan.why);
    return SH_OK;
}

/* A station with another scanner has its own site. That one gives the warnings and has the stretches. */
static int plan_station(const struct site *site, struct site_station *s, const struct sh_report *report,
                        struct sh_err *err)
{
    const struct config *cfg = site->cfg;
    const int serves = config_serves(cfg, (uint32_t)(s - site->station));
    const int by_stretch = serves && site->n_knots != 0 && cfg->output.layout == LINE_GEO;
    int rc = by_stretch ? plan_stretches(site, s, report, err)
                        : plan_one(site, s->georef, s->at.position_m, reach_m(site, NULL), &s->plan, err);
    if (rc == SH_OK && serves && s->plan.error_m > cfg->output.tolerance_m && cfg->output.layout == LINE_GEO)
        sh_warn(
            report,
            "station %s: the error of georeferencing by %s may be %.2g m, more than the %.2g m of output.tolerance_m",
            s->station->name, s->plan.method, s->plan.error_m, cfg->output.tolerance_m);
    return rc;
}

/* Opens the geoid that output.heights asks for; site->geoid stays NULL where heights are ellipsoidal. */
static int open_geoid(struct site *site, struct sh_err *err)
{
    const struct config *cfg = site->cfg;
    struct sh_err why;
    int has_heights = cfg->output.crs == GEOREF_UTM || cfg->output.crs == GEOREF_GEODETIC;
    if (cfg->output.heights == HEIGHTS_ELLIPSOID || !has_heights) return SH_OK;
    int rc = georef_geoid_open(&site->geoid, &why);
    if (rc == SH_OK || cfg->output.heights == HEIGHTS_AUTO) return SH_OK;
    return sh_fail(err, rc, "%s: output.heights: %.400s", cfg->file, why.text);
}

/* The longest range that a point may have: the head's with the errors of its instrument, and ten sigma. */
static double longest_m(const struct site *site)
{
    const struct config_instrument *k = &site->cfg->instrument;
    const double range_m = site->cfg->profile.range_max_m;
    return (1.0 + 1e-6 * fabs(k->range_scale_ppm)) * range_m + fabs(k->range_offset_m) + site_range_noise_m(site);
}

/* Sets the scale of a station, or of the stretches of its path. Points that ball-shaped noise takes further are counted
 * as unfit. */
static int scale_station(const struct site *site, struct site_station *s, double scale_m, struct sh_err *err)
{
    int rc = SH_OK;
    const double most_m = longest_m(site);
    if (s->on_stretch == NULL) return georef_scale(s->georef, scale_m, most_m + site->live_reach_m, s->scale, err);
    for (size_t i = 0; i < site->n_stretches && rc == SH_OK; i++)
        rc = georef_scale(s->on_stretch[i].georef, scale_m, most_m + site->stretch[i].reach_m, s->on_stretch[i].scale,
                          err);
    return rc;
}

static const double FINEST_M = 1e-6, MOST_RANGE_COUNTS = 4294967295.0;

/* Sets the scale of all stations; fails where one does not fit. In the polar layout ranges must fit into 32 bits, since
 * a longer one would be read as a short one; polar points have no coordinates, so all of these fit. In the geo layout
 * coordinates from anywhere on a stretch must fit into 31 bits. */
static int scale_stations(struct site *site, double scale_m, struct sh_err *err)
{
    const struct config *cfg = site->cfg;
    const int polar = cfg->output.layout == LINE_POLAR;
    const double most_m = longest_m(site) + site_ball_m(site), least_m = most_m / MOST_RANGE_COUNTS;
    int rc = SH_OK;
    struct sh_err why;
    site->scale_m = scale_m;
    if (polar && scale_m < least_m)
        return sh_fail(
            err, SH_EINPUT,
            "%s: output.scale_m: %g: ranges up to %.6g m do not fit into 32 bits; allowed 0 (automatic) and from "
            "%.3g m on",
            cfg->file, scale_m, most_m, digits_up(least_m, 3));
    for (uint32_t i = 0; i < site->n_stations && rc == SH_OK; i++) {
        struct site_station *s = &site->station[i];
        rc = scale_station(site, s, scale_m, &why);
        if (polar) rc = SH_OK;
        if (rc != SH_OK)
            sh_fail(err, rc, "%s: output.scale_m: station %s: %.300s", cfg->file, s->station->name, why.text);
    }
    return rc;
}

/* Chooses the finest 1e-6 x 10^n m with which everything fits, unless the configuration names a scale. In the polar
 * layout there always is one. */
static int choose_scale(struct site *site, struct sh_err *err)
{
    const double given_m = site->cfg->output.scale_m;
    const int polar = site->cfg->output.layout == LINE_POLAR;
    double scale_m = given_m > 0.0 ? given_m : FINEST_M;
    int rc = scale_stations(site, scale_m, err);
    while (rc != SH_OK && given_m <= 0.0 && (polar || scale_m < 1.0))
        rc = scale_stations(site, scale_m *= 10.0, err);
    return rc;
}

/* Returns the largest coordinate that has to fit, in metres. */
static double most_coordinate_m(const struct site *site)
{
    const double range_m = longest_m(site);
    double most_m = 0.0;
    for (uint32_t i = 0; i < site->n_stations; i++) {
        const struct site_station *s = &site->station[i];
        if (s->on_stretch == NULL) most_m = fmax(most_m, georef_span_m(s->georef, range_m + site->live_reach_m));
        for (size_t k = 0; s->on_stretch != NULL && k < site->n_stretches; k++)
            most_m = fmax(most_m, georef_span_m(s->on_stretch[k].georef, range_m + site->stretch[k].reach_m));
    }
    return most_m;
}

static void warn_of_coarse_counts(const struct site *site, const struct sh_report *report)
{
    const int polar = site->cfg->output.layout == LINE_POLAR;
    if (site->cfg->output.scale_m > 0.0 || site->scale_m < 2.0 * FINEST_M) return;
    sh_warn(
        report,
        "output.scale_m: a count on the wire is %g m, not %g: %s up to %.6g m must fit into %d bits, but at %g m only "
        "those up to %.0f m do",
        site->scale_m, FINEST_M, polar ? "ranges" : "coordinates",
        polar ? longest_m(site) + site_ball_m(site) : most_coordinate_m(site), polar ? 32 : 31, FINEST_M,
        FINEST_M * MOST_RANGE_COUNTS / (polar ? 1.0 : 2.0));
}

/* Returns the longest count of a station, in metres, within the reach of scale_station. Beyond it no point lies, though
 * a count of longitude may be longer there. */
static double count_m(const struct site *site, const struct site_station *s)
{
    double most_m = 0.0;
    const double range_m = longest_m(site);
    if (s->on_stretch == NULL) return georef_count_m(s->georef, range_m + site->live_reach_m, s->scale);
    for (size_t i = 0; i < site->n_stretches; i++)
        most_m = fmax(most_m, georef_count_m(s->on_stretch[i].georef, range_m + site->stretch[i].reach_m,
                                             s->on_stretch[i].scale));
    return most_m;
}

/* Sets metres per count, and the CRS's units per count for each station. */
static int scale_all(struct site *site, const struct sh_report *report, struct sh_err *err)
{
    int rc = choose_scale(site, err);
    if (rc == SH_OK) warn_of_coarse_counts(site, report);
    for (uint32_t i = 0; i < site->n_stations && rc == SH_OK && site->cfg->output.layout == LINE_GEO; i++) {
        if (!config_serves(site->cfg, i)) continue;
        double most_m = count_m(site, &site->station[i]);
        if (most_m > site->scale_m * (1.0 + 1e-9))
            sh_warn(
                report,
                "station %s: a count of longitude is up to %.2g m, all others at most %g m: near a pole 360 degrees "
                "must fit into 31 bits",
                site->station[i].station->name, most_m, site->scale_m);
    }
    return rc;
}

static int add_georef(struct site *site, struct site_station *s, const struct sh_report *report, struct sh_err *err)
{
    const struct config *cfg = site->cfg;
    struct georef_spec spec = {.crs = cfg->output.crs, .geoid = site->geoid};
    site_grid(site, &spec.utm_zone, &spec.side);
    struct sh_err why = {0};
    int rc = sh_check_stop(report, err);
    if (rc == SH_OK) rc = placement_georef(&s->at, &site->anchor, &spec, err);
    if (rc != SH_OK) return rc;
    rc = georef_create(&spec, &s->georef, &why);
    if (rc != SH_OK) return sh_fail(err, rc, "%s: station %s: %.300s", cfg->file, s->station->name, why.text);
    int epsg = georef_epsg(s->georef), first = georef_epsg(site->station[0].georef);
    if (epsg != first)
        sh_warn(report, "%s: station %s is in EPSG %d, station %s in %d: their points have no common system", cfg->file,
                s->station->name, epsg, site->station[0].station->name, first);
    return plan_station(site, s, report, err);
}

int site_georeference(struct site *site, const struct sh_report *report, struct sh_err *err)
{
    int rc = open_geoid(site, err);
    for (uint32_t i = 0; i < site->n_stations && rc == SH_OK; i++)
        rc = add_georef(site, &site->station[i], report, err);
    return rc == SH_OK ? scale_all(site, report, err) : rc;
}

int site_georeference_one(struct site *site, uint32_t station, struct sh_err *err)
{
    int rc = add_georef(site, &site->station[station], NULL, err);
    return rc == SH_OK ? scale_all(site, NULL, err) : rc;
}

void site_free_georeference(struct site *site, uint32_t station)
{
    struct site_station *s = &site->station[station];
    for (size_t k = 0; s->on_stretch != NULL && k < site->n_stretches; k++)
        georef_free(s->on_stretch[k].georef);
    free(s->on_stretch);
    georef_free(s->georef);
}
