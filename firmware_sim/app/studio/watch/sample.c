/* SPDX-License-Identifier: MIT */
/* The sampled points of a scan: those of one in `every` pulses, chosen by the pulse's hash. So the sample can be
 * thinned later and is still spread evenly. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "firmware_sim/app/studio/watch/inside.h"
#include "firmware_sim/base/clock.h"

/* How far from a point the scene is looked for: the default of `scanhead report`. */
#define REACH_M    10.0
#define REACH_TEXT "10 m"

int watch_sample_open(struct watch *w, struct sh_err *err)
{
    struct watch_sample *s = &w->sample;
    const size_t n = WATCH_MOST_POINTS;
    s->xyz_m = malloc(n * sizeof *s->xyz_m);
    s->hash = malloc(n * sizeof *s->hash);
    s->distance_m = malloc(n * sizeof *s->distance_m);
    s->triangle = malloc(n * sizeof *s->triangle);
    int rc = deviation_points_create(n, &s->points, err);
    if (rc == SH_OK) s->points.met = malloc(n * sizeof *s->points.met);
    if (rc == SH_OK &&
        (s->xyz_m == NULL || s->hash == NULL || s->distance_m == NULL || s->triangle == NULL || s->points.met == NULL))
        rc = sh_fail(err, SH_ENOMEM, "no memory for the points that are looked at");
    return rc;
}

void watch_sample_close(struct watch *w)
{
    struct watch_sample *s = &w->sample;
    free(s->xyz_m);
    free(s->hash);
    free(s->distance_m);
    free(s->triangle);
    deviation_points_free(&s->points);
}

void watch_sample_begin(struct watch *w)
{
    w->sample.n = w->sample.done = 0;
    w->sample.every = 1;
    w->sample.cell_m = REPORT_CELL_M;
    w->sample.spent_ns = 0.0;
}

static void move_point(struct watch_sample *s, size_t to, size_t from)
{
    const struct deviation_points *p = &s->points;
    memcpy(s->xyz_m[to], s->xyz_m[from], sizeof *s->xyz_m);
    s->hash[to] = s->hash[from];
    s->distance_m[to] = s->distance_m[from];
    s->triangle[to] = s->triangle[from];
    p->met[to] = p->met[from];
    p->along_m[to] = p->along_m[from];
    p->sigma_m[to] = p->sigma_m[from];
    p->counts_m[to] = p->counts_m[from];
    p->cosine[to] = p->cosine[from];
    p->range_m[to] = p->range_m[from];
}

/* Keeps the points of half of the pulses. */
static void thin(struct watch_sample *s)
{
    size_t n = 0, done = 0;
    s->every *= 2;
    for (size_t i = 0; i < s->n; i++) {
        if ((s->hash[i] & (s->every - 1)) != 0) continue;
        done += i < s->done;
        move_point(s, n++, i);
    }
    s->n = n;
    s->done = done;
}

void watch_sample_add(struct watch *w, const double p_m[3], uint32_t hash)
{
    struct watch_sample *s = &w->sample;
    while (s->n == WATCH_MOST_POINTS && s->every < WATCH_LEAST_SHARE)
        thin(s);
    if (s->n == WATCH_MOST_POINTS || (hash & (s->every - 1)) != 0) return;
    memcpy(s->xyz_m[s->n], p_m, sizeof *s->xyz_m);
    s->hash[s->n++] = hash;
}

/* ---- comparing */

static struct deviation_points points_from(const struct deviation_points *p, size_t i)
{
    return (struct deviation_points){.along_m = p->along_m + i,
                                     .sigma_m = p->sigma_m + i,
                                     .counts_m = p->counts_m + i,
                                     .cosine = p->cosine + i,
                                     .range_m = p->range_m + i,
                                     .met = p->met + i};
}

/* The beams of a head that moves do not come from one place. */
static void without_beams(const struct deviation_points *p, const uint32_t *triangle, size_t n)
{
    for (size_t i = 0; i < n; i++) {
        p->along_m[i] = p->sigma_m[i] = p->counts_m[i] = p->cosine[i] = p->range_m[i] = (float)NAN;
        p->met[i] = triangle[i];
    }
}

/* Thins the sample until comparing it fits the budget, by the time that one point takes and by how many have come.
 * Reading the stream and working out figures come first; comparing has what they leave, but at least a tenth of the
 * budget. The budget of the first second is there at once: points that are passed over now can't be sampled later. */
static void adapt(struct watch *w, size_t n, int64_t took_ns)
{
    struct watch_sample *s = &w->sample;
    const double point_ns = (double)took_ns / (double)n, share = w->options.cpu_share;
    s->point_ns = s->point_ns > 0.0 ? 0.7 * s->point_ns + 0.3 * point_ns : point_ns;
    s->spent_ns += (double)took_ns;
    if (!(share > 0.0)) return;
    const double budget_ns = share * ((double)(clock_now_ns() - w->began_ns) + 1e9);
    const double others_ns = (double)(clock_thread_ns() - w->began_thread_ns) - s->spent_ns;
    /* Not all of it is used, since points that are thinned out later have cost time, too. */
    const double rest_ns = 0.6 * fmax(budget_ns - others_ns, 0.1 * budget_ns);
    while (s->every < WATCH_LEAST_SHARE && s->point_ns * (double)w->at.points / s->every > rest_ns)
        thin(s);
}

int watch_sample_compare(struct watch *w, struct sh_err *err)
{
    struct watch_sample *s = &w->sample;
    const size_t first = s->done, n = s->n - s->done;
    if (n == 0) return SH_OK;
    const int64_t from_ns = clock_thread_ns();
    const struct cloud cloud = {.n = n, .xyz_m = s->xyz_m + first, .epsg = CLOUD_EPSG_UNKNOWN};
    const struct cloud_site site = {.bvh = w->site->bvh, .n_stations = 1, .max_m = REACH_M, .threads = 1};
    const struct cloud_compared compared = {&cloud, &site, s->distance_m + first, s->triangle + first};
    const struct deviation_points points = points_from(&s->points, first);
    int rc = cloud_compare(&cloud, &site, NULL, s->distance_m + first, s->triangle + first, err);
    if (rc == SH_OK && w->site->moving) without_beams(&points, s->triangle + first, n);
    if (rc == SH_OK && !w->site->moving) rc = deviation_along(&compared, &w->now, NULL, &points, err);
    if (rc != SH_OK) return rc;
    for (size_t i = first; i < s->n; i++)
        if (s->distance_m[i] <= w->seen.cell_m) watch_seen_mark(&w->seen, w->at.station, s->points.met[i], s->xyz_m[i]);
    s->done = s->n;
    adapt(w, n, clock_thread_ns() - from_ns);
    return SH_OK;
}

/* ---- figures */

static int density(struct watch *w, const struct cloud *cloud, struct sh_err *err)
{
    struct watch_sample *s = &w->sample;
    const struct cloud_site site = {.bvh = w->site->bvh, .n_stations = 1, .max_m = REACH_M, .threads = 1};
    const struct cloud_compared compared = {cloud, &site, s->distance_m, s->triangle};
    const struct figures_on_scene in = {&compared, w->site->scene, s->points.range_m};
    struct figures_density all;
    /* While points come the cells get smaller bit by bit; in the end they are those of a report. */
    const double first_m = w->at.over ? REPORT_CELL_M : fmax(0.5 * s->cell_m, REPORT_CELL_M);
    const int rc = figures_density_fit(&in, first_m, NULL, &all, &w->at.density, err);
    if (rc != SH_OK) return rc;
    w->at.density_cell_m = s->cell_m = all.cell_m;
    figures_density_free(&all);
    w->at.density.p5 *= s->every;
    w->at.density.p50 *= s->every;
    w->at.density.p95 *= s->every;
    return SH_OK;
}

static void sample_judge(struct watch *w)
{
    const struct watch_sample *s = &w->sample;
    struct report_verdict *v = &w->at.verdict;
    *v = (struct report_verdict){0};
    for (size_t i = 0; i < s->n && !w->site->moving; i++)
        report_count(v, &w->now, s->distance_m[i], (double)s->points.along_m[i], (double)s->points.range_m[i]);
    const struct report_subject subject = {&w->at.figures, &w->now, w->site->moving, REACH_TEXT};
    report_judge_one(&subject, v);
    if (w->site->moving) snprintf(v->text, sizeof v->text, "Not judged: the head moves.");
}

static void find_largest(struct watch *w)
{
    const struct watch_sample *s = &w->sample;
    for (int k = 0; k < 3; k++)
        w->at.max_at_m[k] = (double)NAN;
    for (size_t i = 0; i < s->n; i++) {
        if (s->distance_m[i] != w->at.figures.max_m) continue;
        memcpy(w->at.max_at_m, s->xyz_m[i], sizeof w->at.max_at_m);
        return;
    }
}

int watch_sample_figures(struct watch *w, struct sh_err *err)
{
    struct watch_sample *s = &w->sample;
    const struct figures_in in = {.n = s->n, .distance_m = s->distance_m, .points = &s->points};
    const struct cloud cloud = {.n = s->n, .xyz_m = s->xyz_m, .epsg = CLOUD_EPSG_UNKNOWN};
    int rc = figures_by(&in, 1, NULL, NULL, &w->at.figures, err);
    if (rc == SH_OK) rc = density(w, &cloud, err);
    if (rc != SH_OK) return rc;
    if (w->at.figures.along > 0)
        figures_histogram_of_signed(s->points.along_m, s->n, REPORT_SHOWN, &w->at.histogram);
    else
        figures_histogram_of(s->distance_m, s->n, REPORT_SHOWN, &w->at.histogram);
    find_largest(w);
    sample_judge(w);
    w->at.expects = !w->site->moving && deviation_terms_of(&w->now, &w->at.expected);
    w->at.every = s->every;
    w->at.sampled_points = s->n;
    return SH_OK;
}
