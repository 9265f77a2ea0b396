/* Georeferencing of a site: heights, method, counts. */
#include "firmware_sim/site_georef.h"

#include <math.h>

/* How far points can be from a station. */
static double reach_m(const struct site *site)
{
    return (site->cfg->profile.range_max_m + site->path_reach_m) * SITE_MARGIN;
}

/* Where points can be, seen from a station: within the scene, and within the head's range. A hundredth more, and ten
 * sigma, for noise. */
static void extent_from(const struct site *site, const double station_m[3], struct plan_georef_need *need)
{
    const struct config_profile *p = &site->cfg->profile;
    double reach = reach_m(site), far[3];
    double noise_m = 10.0 * (p->range_sigma_m + 1e-6 * p->range_sigma_ppm * p->range_max_m);
    for (int i = 0; i < 3; i++) {
        double low = station_m[i] - site->scene->min_m[i], high = site->scene->max_m[i] - station_m[i];
        far[i] = fmax(low, high) * SITE_MARGIN + noise_m;
    }
    need->radius_m = need->height_m = reach;
    if (site->n_movers > 0) return; /* they may go anywhere */
    need->radius_m = fmin(reach, hypot(far[0], far[1]));
    need->height_m = fmin(reach, far[2]);
}

int site_plan_georef(const struct site *site, struct site_station *s, const struct sh_report *report,
                     struct sh_err *err)
{
    const struct config *cfg = site->cfg;
    struct plan_georef_need need = {.tolerance_m = cfg->tolerance_m, .forced = cfg->georef};
    enum georef_method method;
    struct sh_err why;
    extent_from(site, s->at.position_m, &need);
    int rc = plan_georef(s->georef, &need, &method, &s->plan, &why);
    if (rc != SH_OK) return sh_fail(err, rc, "%s: output.georef: %.300s", cfg->file, why.text);
    if (s->plan.error_m > need.tolerance_m && cfg->layout == LINE_GEO)
        sh_warn(report, "station %s: georeferencing by %s may be off by %.2g m, more than output.tolerance_m",
                s->station->name, s->plan.method, s->plan.error_m);
    return georef_set_method(s->georef, method, err);
}

int site_open_geoid(struct site *site, struct sh_err *err)
{
    const struct config *cfg = site->cfg;
    struct sh_err why;
    int has_heights = cfg->crs == GEOREF_UTM || cfg->crs == GEOREF_GEODETIC;
    if (cfg->heights == HEIGHTS_ELLIPSOID || !has_heights) return SH_OK;
    int rc = georef_geoid_open(&site->geoid, &why);
    if (rc == SH_OK || cfg->heights == HEIGHTS_AUTO) return SH_OK;
    return sh_fail(err, rc, "%s: output.heights: %.400s", cfg->file, why.text);
}

/* Per station; whether they all fit. Polar points have no coordinates that need to. */
static int scale_stations(struct site *site, double scale_m, struct sh_err *err)
{
    int rc = SH_OK;
    struct sh_err why;
    site->scale_m = scale_m;
    for (uint32_t i = 0; i < site->n_stations && rc == SH_OK; i++) {
        struct site_station *s = &site->station[i];
        rc = georef_scale(s->georef, scale_m, reach_m(site), s->scale, &why);
        if (site->cfg->layout == LINE_POLAR) rc = SH_OK;
        if (rc != SH_OK)
            sh_fail(err, rc, "%s: output.scale_m: station %s: %.300s", site->cfg->file, s->station->name, why.text);
    }
    return rc;
}

/* The finest 1e-6 x 10^n m with which the head's whole range, from all of its path, fits into 31 bits, with a hundredth
 * left for noise, unless the configuration names a scale. */
int site_choose_scale(struct site *site, struct sh_err *err)
{
    const struct config *cfg = site->cfg;
    if (cfg->scale_m > 0.0) return scale_stations(site, cfg->scale_m, err);
    double scale_m = 1e-6;
    while (reach_m(site) / scale_m > 2147483647.0)
        scale_m *= 10.0;
    int rc = scale_stations(site, scale_m, err);
    while (rc != SH_OK && scale_m < 1.0)
        rc = scale_stations(site, scale_m *= 10.0, err);
    return rc;
}
