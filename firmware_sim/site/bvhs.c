#include "firmware_sim/site/site_inside.h"

#include <math.h>

#include "core/vec3.h"

/* Where *out is not NULL it is the caller's, even after an error. */
static int build(const struct site *site, const struct scene *scene, const struct site_sphere *from,
                 const struct sh_report *report, struct bvh **out, struct sh_err *err)
{
    *out = NULL;
    const int order = site->plan.methods.order_exactly && !site_order_can_wait(site);
    int rc = bvh_create(scene, from->centre_m, from->radius_m, site->cfg->loop.threads, report, out, err);
    return rc == SH_OK && order ? bvh_order_exactly(*out, report, err) : rc;
}

int site_order_bvhs(struct site *site, const struct sh_report *report, struct sh_err *err)
{
    int rc = SH_OK;
    for (uint32_t i = 0; i < site->n_bvh && rc == SH_OK; i++)
        rc = bvh_order_exactly(site->bvh[i], report, err);
    return rc;
}

int site_build_mover_bvhs(struct site *site, const struct sh_report *report, struct sh_err *err)
{
    int rc = SH_OK;
    for (uint32_t i = 0; i < site->n_movers && rc == SH_OK; i++) {
        struct site_mover *m = &site->mover[i];
        rc = build(site, m->scene, &(struct site_sphere){m->centre_m, site->cfg->profile.range_max_m}, report, &m->bvh,
                   err);
    }
    return rc;
}

int site_add_bvh(struct site *site, const struct site_sphere *from, const struct sh_report *report, struct bvh **out,
                 struct sh_err *err)
{
    int rc = build(site, site->scene, from, report, out, err);
    if (*out != NULL) site->bvh[site->n_bvh++] = *out;
    return rc;
}

/* Whether stations that share within that distance need no more BVHs than there may be. */
static int are_few(const struct site *site, double within_m)
{
    const double *first[CONFIG_MAX_STATIONS];
    uint32_t n = 0;
    for (uint32_t i = 0, k; i < site->n_stations; i++) {
        const double *at_m = site->station[i].at.position_m;
        for (k = 0; k < n && vec3_distance(first[k], at_m) > within_m;)
            k++;
        if (k < n) continue;
        if (n == CONFIG_MAX_STATIONS) return 0;
        first[n++] = at_m;
    }
    return 1;
}

/* How far from a BVH's origin a station may be that shares it. Triangles are widened for the reach: where it is
 * many times the scene's size, most hits are in doubt, and deciding takes seconds. */
static double sharing_m(const struct site *site)
{
    double within_m = vec3_distance(site->scene->max_m, site->scene->min_m);
    while (within_m > 0.0 && within_m < SITE_BVH_REACH_M && !are_few(site, within_m))
        within_m *= 2.0;
    return within_m > 0.0 ? fmin(SITE_BVH_REACH_M, within_m) : SITE_BVH_REACH_M;
}

/* How far from a BVH's origin rays of the stations begin that will share it. */
static double reach_of_stations(const struct site *site, const double origin_m[3], double within_m)
{
    double reach_m = 0.0;
    for (uint32_t i = 0; i < site->n_stations; i++) {
        const double *at_m = site->station[i].at.position_m;
        double d = vec3_distance(at_m, origin_m);
        if (d <= within_m) reach_m = fmax(reach_m, d + site_ray_reach_m(site, at_m));
    }
    return reach_m;
}

static struct bvh *find(const struct site *site, const double station_m[3], double within_m)
{
    for (uint32_t i = 0; i < site->n_bvh; i++) {
        double origin_m[3];
        bvh_origin(site->bvh[i], origin_m);
        if (vec3_distance(origin_m, station_m) <= within_m) return site->bvh[i];
    }
    return NULL;
}

int site_build_station_bvhs(struct site *site, const struct sh_report *report, struct sh_err *err)
{
    const double within_m = sharing_m(site);
    int rc = SH_OK;
    for (uint32_t i = 0; i < site->n_stations && rc == SH_OK; i++) {
        struct site_station *s = &site->station[i];
        s->bvh = find(site, s->at.position_m, within_m);
        if (s->bvh != NULL) continue;
        if (site->n_bvh == CONFIG_MAX_STATIONS)
            return sh_fail(err, SH_EINPUT, "%s: the stations are too far apart; allowed %d groups of %.0f m across",
                           site->cfg->file, CONFIG_MAX_STATIONS, 2.0 * SITE_BVH_REACH_M);
        const struct site_sphere from = {s->at.position_m, reach_of_stations(site, s->at.position_m, within_m)};
        rc = site_add_bvh(site, &from, report, &s->bvh, err);
    }
    return rc;
}
