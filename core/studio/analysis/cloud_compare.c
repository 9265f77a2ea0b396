/* SPDX-License-Identifier: MIT */
#include <math.h>
#include <stdatomic.h>
#include <string.h>

#include "core/distance.h"
#include "core/studio/cloud.h"
#include "core/together.h"

enum { CHUNK = 4096 };

/* The search starts with this and grows tenfold: its cost grows with the reach, and points of a scan lie on
 * the scene but for the head's noise. */
static const double FIRST_REACH_M = 0.01;

struct work {
    const struct cloud *cloud;
    const struct cloud_site *site;
    const char *what;
    void (*point)(const struct work *w, size_t i); /* called for each point */
    double (*xyz_m)[3];                            /* of cloud_into_scene: the cloud's own */
    double *distance_m;
    uint32_t *triangle;
    const struct sh_report *report;
    atomic_size_t next; /* point to take up */
};

static const struct georef *georef_of(const struct cloud *cloud, const struct cloud_site *site, size_t i)
{
    return site->georef != NULL ? site->georef[cloud_station(cloud, i) - 1] : NULL;
}

/* Returns what a scene needs for points in this system, which came from `record --crs`. Empty: nothing helps. */
static const char *advice_for(int64_t epsg, const struct georef *georef)
{
    if (georef != NULL && georef_epsg(georef) != 0) return "";
    if (epsg == 4978) return "; allowed with --set output.layout=geo --set output.crs=ecef";
    if (epsg == 4979) return "; allowed with --set output.layout=geo --set output.crs=geodetic";
    const int64_t zone = epsg - (epsg > 32700 ? 32700 : 32600);
    return zone >= 1 && zone <= 61 ? "; allowed with --set output.layout=geo --set output.crs=utm" : "";
}

static int check_stations(const struct cloud *cloud, const struct cloud_site *site, struct sh_err *err)
{
    for (size_t i = 0; i < cloud->n; i++) {
        unsigned station = cloud_station(cloud, i);
        if (station > site->n_stations)
            return sh_fail(err, SH_EINPUT, "point %zu is of station %u; there are %u", i + 1, station,
                           site->n_stations);
        const struct georef *georef = georef_of(cloud, site, i);
        int epsg = georef != NULL ? georef_epsg(georef) : 0;
        if (cloud->epsg != CLOUD_EPSG_UNKNOWN && cloud->epsg != epsg)
            return sh_fail(err, SH_EINPUT,
                           "the points are in EPSG %lld, but those of station %u must be in EPSG %d (0: scene frame)%s",
                           (long long)cloud->epsg, station, epsg, advice_for(cloud->epsg, georef));
    }
    return SH_OK;
}

void cloud_to_scene(const struct cloud *cloud, const struct cloud_site *site, size_t i, double p_prcs[3])
{
    const double *p = cloud->xyz_m[i];
    const struct georef *georef = georef_of(cloud, site, i);
    double d_crs[3];
    memcpy(p_prcs, p, 3 * sizeof *p);
    if (georef == NULL) return;
    georef_difference(georef, p, d_crs);
    georef_reverse(georef, d_crs, p_prcs);
}

/* A triangle that is found within some reach is the nearest of all. */
static int find_nearest(const struct bvh *bvh, double max_m, const double p_prcs[3], struct distance_hit *hit)
{
    for (double reach_m = FIRST_REACH_M; reach_m < max_m; reach_m *= 10)
        if (distance_query(bvh, p_prcs, reach_m, hit)) return 1;
    return distance_query(bvh, p_prcs, max_m, hit);
}

static void compare_point(const struct work *w, size_t i)
{
    struct distance_hit hit;
    double p_prcs[3];
    w->distance_m[i] = NAN;
    w->triangle[i] = CLOUD_TRIANGLE_NONE;
    if (isnan(w->cloud->xyz_m[i][0])) return;
    w->distance_m[i] = INFINITY;
    cloud_to_scene(w->cloud, w->site, i, p_prcs);
    const struct bvh *body = NULL;
    if (w->site->body != NULL && w->cloud->label != NULL)
        body = w->site->body(w->site->body_ctx, cloud_station(w->cloud, i), w->cloud->label[i], p_prcs);
    if (!find_nearest(body != NULL ? body : w->site->bvh, w->site->max_m, p_prcs, &hit)) return;
    w->distance_m[i] = hit.distance_m;
    if (body == NULL) w->triangle[i] = hit.triangle;
}

static void work_on(void *ctx, int reports)
{
    struct work *w = ctx;
    size_t n = w->cloud->n, first;
    while ((first = atomic_fetch_add(&w->next, CHUNK)) < n && !sh_stopped(w->report)) {
        size_t end = n - first < CHUNK ? n : first + CHUNK;
        for (size_t i = first; i < end; i++)
            w->point(w, i);
        if (reports) sh_progress(w->report, w->what, (double)end / (double)n);
    }
}

static int work_together(struct work *w, struct sh_err *err)
{
    together(w->site->threads, work_on, w);
    return sh_check_stop(w->report, err);
}

int cloud_compare(const struct cloud *cloud, const struct cloud_site *site, const struct sh_report *report,
                  double *distance_m, uint32_t *triangle, struct sh_err *err)
{
    struct work w = {.cloud = cloud,
                     .site = site,
                     .what = "comparing with the scene",
                     .point = compare_point,
                     .distance_m = distance_m,
                     .triangle = triangle,
                     .report = report};
    int rc = check_stations(cloud, site, err);
    return rc == SH_OK ? work_together(&w, err) : rc;
}

static void move_point(const struct work *w, size_t i)
{
    double p_prcs[3];
    cloud_to_scene(w->cloud, w->site, i, p_prcs);
    memcpy(w->xyz_m[i], p_prcs, sizeof p_prcs);
}

int cloud_into_scene(struct cloud *cloud, struct cloud_site *site, const struct sh_report *report, struct sh_err *err)
{
    struct work w = {.cloud = cloud,
                     .site = site,
                     .what = "turning the points into the scene's frame",
                     .point = move_point,
                     .xyz_m = cloud->xyz_m,
                     .report = report};
    int rc = check_stations(cloud, site, err);
    if (rc == SH_OK && site->georef != NULL) rc = work_together(&w, err);
    if (rc != SH_OK) return rc;
    site->georef = NULL;
    cloud->epsg = 0;
    return SH_OK;
}
