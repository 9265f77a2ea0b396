#include <math.h>
#include <pthread.h>
#include <stdatomic.h>
#include <string.h>

#include "core/cloud.h"

enum { CHUNK = 4096, MAX_THREADS = 256 };

/* The search starts with this and grows tenfold: its cost grows with the reach, and points of a scan lie on
 * the scene but for the head's noise. */
static const double FIRST_REACH_M = 0.01;

struct work {
    const struct cloud *cloud;
    const struct cloud_site *site;
    double *distance_m;
    uint32_t *triangle;
    atomic_size_t next; /* point to take up */
};

static unsigned station_of(const struct cloud *cloud, size_t i)
{
    return cloud->station != NULL ? cloud->station[i] : 1;
}

static const struct georef *georef_of(const struct cloud *cloud, const struct cloud_site *site, size_t i)
{
    return site->georef != NULL ? site->georef[station_of(cloud, i) - 1] : NULL;
}

static int check_stations(const struct cloud *cloud, const struct cloud_site *site, struct sh_err *err)
{
    for (size_t i = 0; i < cloud->n; i++) {
        unsigned station = station_of(cloud, i);
        if (station > site->n_stations)
            return sh_fail(err, SH_EINPUT, "point %zu is of station %u; there are %u", i + 1, station,
                           site->n_stations);
        const struct georef *georef = georef_of(cloud, site, i);
        int epsg = georef != NULL ? georef_epsg(georef) : 0;
        if (cloud->epsg != CLOUD_EPSG_UNKNOWN && cloud->epsg != epsg)
            return sh_fail(err, SH_EINPUT,
                           "the points are in EPSG %lld, those of station %u have to be in EPSG %d (0: scene frame)",
                           (long long)cloud->epsg, station, epsg);
    }
    return SH_OK;
}

static void to_scene(const struct work *w, size_t i, double p_prcs[3])
{
    const double *p = w->cloud->xyz_m[i];
    const struct georef *georef = georef_of(w->cloud, w->site, i);
    double d_crs[3];
    memcpy(p_prcs, p, 3 * sizeof *p);
    if (georef == NULL) return;
    georef_difference(georef, p, d_crs);
    georef_reverse(georef, d_crs, p_prcs);
}

/* Whatever the reach, what is found within it is the nearest. */
static int find_nearest(const struct distance *index, double max_m, const double p_prcs[3], struct distance_hit *hit)
{
    for (double reach_m = FIRST_REACH_M; reach_m < max_m; reach_m *= 10)
        if (distance_query(index, p_prcs, reach_m, hit)) return 1;
    return distance_query(index, p_prcs, max_m, hit);
}

static void compare_point(const struct work *w, size_t i)
{
    struct distance_hit hit;
    double p_prcs[3];
    w->distance_m[i] = NAN;
    w->triangle[i] = CLOUD_TRIANGLE_NONE;
    if (isnan(w->cloud->xyz_m[i][0])) return;
    w->distance_m[i] = INFINITY;
    to_scene(w, i, p_prcs);
    const struct distance *body = NULL;
    if (w->site->body != NULL && w->cloud->label != NULL)
        body = w->site->body(w->site->body_ctx, station_of(w->cloud, i), w->cloud->label[i], p_prcs);
    if (!find_nearest(body != NULL ? body : w->site->index, w->site->max_m, p_prcs, &hit)) return;
    w->distance_m[i] = hit.distance_m;
    if (body == NULL) w->triangle[i] = hit.triangle;
}

static void work_on(struct work *w, const struct sh_report *report)
{
    size_t n = w->cloud->n, first;
    while ((first = atomic_fetch_add(&w->next, CHUNK)) < n) {
        size_t end = n - first < CHUNK ? n : first + CHUNK;
        for (size_t i = first; i < end; i++)
            compare_point(w, i);
        if (report != NULL) sh_progress(report, "comparing with the scene", (double)end / (double)n);
    }
}

static void *helper_main(void *work)
{
    work_on(work, NULL);
    return NULL;
}

int cloud_compare(const struct cloud *cloud, const struct cloud_site *site, const struct sh_report *report,
                  double *distance_m, uint32_t *triangle, struct sh_err *err)
{
    int rc = check_stations(cloud, site, err);
    if (rc != SH_OK) return rc;
    struct work w = {.cloud = cloud, .site = site, .distance_m = distance_m, .triangle = triangle};
    pthread_t helper[MAX_THREADS];
    unsigned n = 0;
    /* With fewer threads than asked for it takes longer; nothing else changes. */
    while (n + 1 < site->threads && n < MAX_THREADS && pthread_create(&helper[n], NULL, helper_main, &w) == 0)
        n++;
    work_on(&w, report);
    while (n > 0)
        pthread_join(helper[--n], NULL);
    return SH_OK;
}
