#include "firmware_sim/site/site_inside.h"

#include <math.h>

#include "core/vec3.h"

static int create(const struct site *site, const struct scene *scene, const struct site_sphere *from, int order,
                  const struct sh_report *report, struct bvh **out, struct sh_err *err)
{
    int rc = bvh_create(scene, from->centre_m, from->radius_m, site->cfg->loop.threads, report, out, err);
    if (rc == SH_OK && order) rc = bvh_order_exactly(*out, report, err);
    if (rc == SH_OK) return rc;
    bvh_free(*out);
    *out = NULL;
    return rc;
}

static int orders_now(const struct site *site)
{
    return site->plan.methods.order_exactly && !site_order_can_wait(site);
}

/* A BVH of the world for rays from the sphere, whose origin is up to within_m away. Its surfaces are ordered as this
 * site would have them, so that its hits don't depend on who shares it. Where the order is put off, and another site
 * has needed it after all, either will do. */
static struct site_bvh *find(const struct site *site, const struct site_sphere *from, double within_m, int ordered)
{
    struct site_bvh *second = NULL;
    const int waits = !ordered && site->plan.methods.order_exactly;
    for (uint32_t i = 0; i < site->world->n_bvh; i++) {
        struct site_bvh *entry = &site->world->bvh[i];
        double origin_m[3];
        bvh_origin(entry->bvh, origin_m);
        const double d = vec3_distance(origin_m, from->centre_m);
        if (d > within_m || d + from->radius_m > entry->reach_m) continue;
        if (entry->is_ordered == ordered) return entry;
        if (waits && second == NULL) second = entry;
    }
    return second;
}

static int add(struct site *site, const struct site_sphere *from, int order, const struct sh_report *report,
               struct site_bvh **out, struct sh_err *err)
{
    struct bvh *bvh;
    int rc = create(site, site->scene, from, order, report, &bvh, err);
    if (rc != SH_OK) return rc;
    rc = site_keep_bvh(site->world, bvh, from->radius_m, order, err);
    if (rc != SH_OK) {
        bvh_free(bvh);
        return rc;
    }
    *out = &site->world->bvh[site->world->n_bvh - 1];
    return SH_OK;
}

/* In place where no other site uses it; else there is another one for this site. */
static int order(struct site *site, uint32_t i, const struct sh_report *report, struct sh_err *err)
{
    struct site_bvh *entry = site->world->bvh, *other;
    double origin_m[3];
    struct bvh *const was = site->bvh[i];
    while (entry->bvh != was)
        entry++;
    if (entry->is_ordered) return SH_OK;
    if (entry->n_users == 1) {
        entry->is_ordered = 1;
        return bvh_order_exactly(was, report, err);
    }
    bvh_origin(was, origin_m);
    const struct site_sphere from = {origin_m, entry->reach_m};
    entry->n_users--;
    int rc = SH_OK;
    if ((other = find(site, &from, 0.0, 1)) == NULL || !other->is_ordered)
        rc = add(site, &from, 1, report, &other, err);
    if (rc != SH_OK) return rc;
    other->n_users++;
    site->bvh[i] = other->bvh;
    for (uint32_t k = 0; k < site->n_stations; k++)
        if (site->station[k].bvh == was) site->station[k].bvh = other->bvh;
    return SH_OK;
}

int site_build_body_bvh(const struct site *site, const struct scene *scene, const struct site_sphere *from,
                        const struct sh_report *report, struct bvh **out, struct sh_err *err)
{
    return create(site, scene, from, orders_now(site), report, out, err);
}

int site_order_bvhs(struct site *site, const struct sh_report *report, struct sh_err *err)
{
    int rc = SH_OK;
    for (uint32_t i = 0; i < site->n_bvh && rc == SH_OK; i++)
        rc = order(site, i, report, err);
    return rc;
}

int site_build_mover_bvhs(struct site *site, const struct sh_report *report, struct sh_err *err)
{
    int rc = SH_OK;
    for (uint32_t i = 0; i < site->n_movers && rc == SH_OK; i++) {
        struct site_mover *m = &site->mover[i];
        const struct site_sphere from = {m->centre_m, site_world_range_max_m(site)};
        if (m->bvh == NULL) rc = create(site, m->scene, &from, orders_now(site), report, &m->bvh, err);
        site->world->mover[i].bvh = m->bvh;
    }
    return rc;
}

int site_add_bvh(struct site *site, const struct site_sphere *from, const struct sh_report *report, struct bvh **out,
                 struct sh_err *err)
{
    struct site_bvh *entry = find(site, from, 0.0, orders_now(site));
    int rc = entry != NULL ? SH_OK : add(site, from, orders_now(site), report, &entry, err);
    if (rc != SH_OK) return rc;
    *out = entry->bvh;
    site_use_bvh(site, entry);
    return SH_OK;
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
        if (d <= within_m) reach_m = fmax(reach_m, d + site_world_ray_reach_m(site, at_m));
    }
    return reach_m;
}

int site_build_station_bvhs(struct site *site, const struct sh_report *report, struct sh_err *err)
{
    const double within_m = sharing_m(site);
    int rc = SH_OK;
    for (uint32_t i = 0; i < site->n_stations && rc == SH_OK; i++) {
        struct site_station *s = &site->station[i];
        const struct site_sphere rays = {s->at.position_m, site_ray_reach_m(site, s->at.position_m)};
        if (!config_serves(site->cfg, i)) continue;
        struct site_bvh *entry = find(site, &rays, within_m, orders_now(site));
        if (entry != NULL) {
            s->bvh = entry->bvh;
            site_use_bvh(site, entry);
            continue;
        }
        if (site->n_bvh == CONFIG_MAX_STATIONS)
            return sh_fail(err, SH_EINPUT, "%s: the stations are too far apart; allowed %d groups of %.0f m across",
                           site->cfg->file, CONFIG_MAX_STATIONS, 2.0 * SITE_BVH_REACH_M);
        double reach_m = reach_of_stations(site, s->at.position_m, within_m);
        if (site->moved) reach_m = fmax(reach_m, within_m + site_world_ray_reach_m(site, s->at.position_m));
        const struct site_sphere from = {s->at.position_m, reach_m};
        rc = site_add_bvh(site, &from, report, &s->bvh, err);
    }
    return rc;
}
