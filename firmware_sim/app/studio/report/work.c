/* SPDX-License-Identifier: MIT */
/* The figures of a report: reads, compares, counts. Nothing is printed here but progress and warnings of loading. */
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#include "core/mat3.h"
#include "firmware_sim/app/ranking.h"
#include "firmware_sim/app/studio/report/report.h"
#include "firmware_sim/config/config.h"
#include "firmware_sim/config/places.h"

/* Counts ghosts (points seen in mirrors), and makes them shots without echo. */
static void leave_out_ghosts(struct report *r)
{
    const struct site_detect *d = &r->site->detect;
    for (uint32_t s = 0; s < r->site->n_stations && d->ghost == NULL; s++)
        d = &sites_of(&r->sites, s)->detect; /* labels mean the same to all scanners */
    struct cloud *c = &r->cloud;
    for (size_t i = 0; d->ghost != NULL && c->label != NULL && i < c->n; i++) {
        if (c->label[i] < d->n_real || c->label[i] >= 2 * d->n_real) continue;
        c->label[i] = CLOUD_LABEL_NONE;
        for (int k = 0; k < 3; k++)
            c->xyz_m[i][k] = (double)NAN;
        r->f.ghosts++;
    }
}

static int work_load(struct report *r, struct sh_err *err)
{
    struct stat file;
    const unsigned columns =
        1u << CLOUD_TIME | 1u << CLOUD_ECHO_COUNT | (config_head_moves(&r->cfg->platform) ? 1u << CLOUD_RANGE : 0u);
    int rc = cloud_read_columns(r->cloud_path, columns, &app_report_seconds, &r->cloud, err);
    if (rc == SH_OK && stat(r->cloud_path, &file) == 0) r->modified = file.st_mtim;
    if (rc == SH_OK) rc = sites_load(r->cfg, SITE_WRITTEN_OUT, &app_report_stderr, &r->sites, err);
    r->site = r->sites.first;
    if (rc == SH_OK) leave_out_ghosts(r);
    return rc;
}

/* Takes a point on a moving body to the body's own frame, and returns the body's BVH. At a stop the body stands still
 * during the scan. */
static const struct bvh *body_of(void *ctx, unsigned station, uint16_t label, double p_prcs[3])
{
    const struct report *r = ctx;
    const struct site *site = r->site;
    uint32_t k = 0, first = site->scene->n_surfaces;
    if (label < first || label >= site->n_surfaces) return NULL;
    if (site->legs != NULL && label == site->legs_label)
        return sites_of(&r->sites, station - 1)->station[station - 1].tripod.bvh;
    for (; label >= first + site->mover[k].scene->n_surfaces; k++)
        first += site->mover[k].scene->n_surfaces;
    struct cast_setup setup;
    site_move(site, station - 1, 0.0, &setup);
    const struct cast_mover *at = &setup.mover[k];
    const double d[3] = {p_prcs[0] - at->shift_m[0], p_prcs[1] - at->shift_m[1], p_prcs[2] - at->shift_m[2]};
    mat3_apply_transposed(at->rotation, d, p_prcs);
    return site->mover[k].bvh;
}

/* Without stops a body's place depends on the time of each point, which not every file has. */
static int check_bodies(const struct report *r, struct sh_err *err)
{
    const struct site *site = r->site;
    if (site->stop != NULL || site->n_movers == 0 || r->cloud.label == NULL) return SH_OK;
    for (size_t i = 0; i < r->cloud.n; i++)
        if (r->cloud.label[i] >= site->scene->n_surfaces && r->cloud.label[i] < site->n_surfaces &&
            (site->legs == NULL || r->cloud.label[i] != site->legs_label))
            return sh_fail(
                err, SH_EINPUT,
                "%s: point %zu is on %s, which moved during the scan; allowed are points on bodies that stand still, "
                "and scans with platform.kind: stops",
                r->cloud_path, i + 1, site_surface(site, r->cloud.label[i])->object);
    return SH_OK;
}

static int prepare(struct report *r, struct sh_err *err)
{
    const struct site *site = r->site;
    r->georef = calloc(site->n_stations, sizeof *r->georef);
    r->f.station = calloc(site->n_stations, sizeof *r->f.station);
    r->f.head = calloc(site->n_stations, sizeof *r->f.head);
    if (r->georef == NULL || r->f.station == NULL || r->f.head == NULL)
        return sh_fail(err, SH_ENOMEM, "no memory for %u stations", site->n_stations);
    for (uint32_t i = 0; i < site->n_stations; i++)
        r->georef[i] = site->station[i].georef;
    r->cloud_site = (struct cloud_site){.bvh = site->bvh,
                                        .georef = r->cfg->output.layout == LINE_GEO ? r->georef : NULL,
                                        .n_stations = site->n_stations,
                                        .max_m = r->max_m,
                                        .threads = config_threads(r->cfg),
                                        .body = site->n_movers > 0 || site->legs != NULL ? body_of : NULL,
                                        .body_ctx = r};
    r->distance_m = malloc((r->cloud.n + 1) * sizeof *r->distance_m);
    r->triangle = malloc((r->cloud.n + 1) * sizeof *r->triangle);
    if (r->distance_m == NULL || r->triangle == NULL)
        return sh_fail(err, SH_ENOMEM, "no memory for %zu distances", r->cloud.n);
    return deviation_points_create(r->cloud.n, &r->points, err);
}

/* The beams of a head that moved do not come from one place. */
static void without_beams(struct report *r)
{
    for (size_t i = 0; i < r->cloud.n; i++) {
        r->points.along_m[i] = r->points.sigma_m[i] = r->points.counts_m[i] = r->points.cosine[i] = (float)NAN;
        r->points.range_m[i] = r->cloud.range_m != NULL ? r->cloud.range_m[i] : (float)NAN;
    }
}

static int work_compare(struct report *r, struct sh_err *err)
{
    const struct site *site = r->site;
    struct sh_err why = {0};
    int rc = prepare(r, err);
    if (rc == SH_OK) rc = check_bodies(r, err);
    if (rc != SH_OK) return rc;
    report_heads(r);
    rc = cloud_compare(&r->cloud, &r->cloud_site, &app_report_seconds, r->distance_m, r->triangle, &why);
    if (rc == SH_OK) {
        cloud_stats(r->distance_m, r->cloud.n, r->tolerance_m, &r->f.stats);
        if (r->f.stats.points > 0) memcpy(r->f.worst, r->cloud.xyz_m[r->f.stats.worst], sizeof r->f.worst);
        r->f.epsg = r->cloud.epsg;
        rc = cloud_into_scene(&r->cloud, &r->cloud_site, &app_report_seconds, &why);
    }
    if (rc == SH_OK) rc = cloud_cover(&r->cloud, site->scene, site->n_surfaces, r->triangle, &r->f.coverage, &why);
    if (rc == SH_OK && site->moving) without_beams(r);
    if (rc == SH_OK && !site->moving) {
        const struct cloud_compared compared = {&r->cloud, &r->cloud_site, r->distance_m, r->triangle};
        rc = deviation_along(&compared, r->f.head, &app_report_seconds, &r->points, &why);
    }
    return rc == SH_OK ? SH_OK : sh_fail(err, rc, "%s: %.300s", r->cloud_path, why.text);
}

static uint32_t by_station(void *ctx, size_t i)
{
    const struct report *r = ctx;
    return cloud_station(&r->cloud, i) - 1;
}

static uint32_t by_label(void *ctx, size_t i)
{
    const struct report *r = ctx;
    const uint16_t label = cloud_surface(&r->cloud, r->site->scene, r->triangle, i);
    return label < r->site->n_surfaces ? label : r->site->n_surfaces;
}

static uint32_t by_range(void *ctx, size_t i)
{
    const struct report *r = ctx;
    const double bin = floor((double)r->points.range_m[i] / r->f.range_step_m);
    return bin >= 0.0 && bin < r->f.n_ranges ? (uint32_t)bin : FIGURES_NO_GROUP;
}

static uint32_t by_incidence(void *ctx, size_t i)
{
    const struct report *r = ctx;
    const double cosine = (double)r->points.cosine[i];
    if (isnan(cosine)) return FIGURES_NO_GROUP;
    const double bin = floor(acos(fmin(cosine, 1.0)) * (2.0 * REPORT_INCIDENCES / M_PI));
    return bin < REPORT_INCIDENCES ? (uint32_t)bin : REPORT_INCIDENCES - 1;
}

/* Bins are 1, 2 or 5 times a power of ten wide. The bins end at the farthest point that is near the scene: a stray one
 * must not put all others into one bin. */
static void choose_ranges(struct report *r)
{
    double far_m = 0.0;
    for (size_t i = 0; i < r->cloud.n; i++)
        if (isfinite(r->points.range_m[i]) && isfinite(r->distance_m[i]))
            far_m = fmax(far_m, (double)r->points.range_m[i]);
    if (!(far_m > 0.0)) return;
    r->f.range_step_m = figures_nice(far_m / (REPORT_MAX_RANGES - 1));
    r->f.n_ranges = (uint32_t)floor(far_m / r->f.range_step_m) + 1;
}

static int tables(struct report *r, struct sh_err *err)
{
    struct report_figures *f = &r->f;
    const struct figures_in in = {.n = r->cloud.n, .distance_m = r->distance_m, .points = &r->points};
    const uint32_t n_stations = r->site->n_stations, n_labels = r->site->n_surfaces + 1;
    struct figures *station = calloc(n_stations, sizeof *station);
    f->label = calloc(n_labels, sizeof *f->label);
    choose_ranges(r);
    int rc = station == NULL || f->label == NULL ? sh_fail(err, SH_ENOMEM, "no memory for the tables") : SH_OK;
    const struct {
        uint32_t n;
        uint32_t (*group)(void *ctx, size_t i);
        struct figures *out;
    } table[] = {{1, NULL, &f->all},
                 {n_stations, by_station, station},
                 {n_labels, by_label, f->label},
                 {f->n_ranges, by_range, f->range},
                 {REPORT_INCIDENCES, by_incidence, f->incidence}};
    for (size_t t = 0; t < sizeof table / sizeof table[0] && rc == SH_OK; t++) {
        sh_progress(&app_report_seconds, "working out tables", (double)t / (sizeof table / sizeof table[0]));
        rc = sh_check_stop(&app_report_seconds, err);
        if (rc == SH_OK) rc = figures_by(&in, table[t].n, table[t].group, r, table[t].out, err);
    }
    for (uint32_t s = 0; s < n_stations && rc == SH_OK; s++)
        f->station[s].figures = station[s];
    free(station);
    return rc;
}

static double points_of(const void *label, uint32_t i)
{
    return (double)((const struct figures *)label)[i].points;
}

static int rank_labels(struct report *r, struct sh_err *err)
{
    const uint32_t n = r->site->n_surfaces + 1;
    for (uint32_t i = 0; i < n; i++)
        r->f.n_with_points += r->f.label[i].points > 0;
    r->f.by_points = ranking_make(n, points_of, r->f.label);
    return r->f.by_points != NULL ? SH_OK : sh_fail(err, SH_ENOMEM, "no memory for %u surfaces", n - 1);
}

static int densities(struct report *r, struct sh_err *err)
{
    struct report_figures *f = &r->f;
    const struct cloud_compared compared = {&r->cloud, &r->cloud_site, r->distance_m, r->triangle};
    const struct figures_on_scene in = {&compared, r->site->scene, r->points.range_m};
    int rc = r->cell_m > 0.0
                 ? figures_density_of(&in, r->cell_m, &app_report_seconds, &f->density, err)
                 : figures_density_fit(&in, REPORT_CELL_M, &app_report_seconds, &f->density, &f->density_all, err);
    if (rc != SH_OK) return rc;
    figures_density_within(&f->density, 0, 0.0, (double)INFINITY, &f->density_all);
    for (uint32_t k = 0; k < f->n_ranges; k++)
        figures_density_within(&f->density, 0, k * f->range_step_m, (k + 1) * f->range_step_m, &f->density_range[k]);
    for (uint32_t s = 0; s < r->site->n_stations; s++)
        figures_density_within(&f->density, s + 1, 0.0, (double)INFINITY, &f->station[s].density);
    return SH_OK;
}

/* Two lines without a point are a pause. */
static int times(struct report *r, struct sh_err *err)
{
    struct report_figures *f = &r->f;
    f->has_echoes = r->cloud.echo != NULL && r->cloud.echo_count != NULL;
    if (f->has_echoes) figures_echoes_of(&r->cloud, f->shots);
    if (r->cloud.time_s == NULL) return SH_OK;
    const uint32_t n = r->site->n_stations;
    f->times = calloc(n, sizeof *f->times);
    f->gap_s = calloc(n, sizeof *f->gap_s);
    if (f->times == NULL || f->gap_s == NULL) return sh_fail(err, SH_ENOMEM, "no memory for %u stations", n);
    for (uint32_t s = 0; s < n; s++) {
        const int64_t lines_uhz = sites_of(&r->sites, s)->cfg->head.settings.lines_uhz;
        f->gap_s[s] = lines_uhz > 0 ? 2.0 / (1e-6 * (double)lines_uhz) : 0.1;
    }
    figures_times_of(&r->cloud, n, f->gap_s, f->times);
    return SH_OK;
}

int report_work(struct report *r, struct sh_err *err)
{
    int rc = work_load(r, err);
    if (rc == SH_OK) rc = work_compare(r, err);
    if (rc != SH_OK) return rc;
    rc = sh_check_stop(&app_report_seconds, err);
    if (rc == SH_OK) rc = tables(r, err);
    if (rc == SH_OK) rc = rank_labels(r, err);
    if (rc == SH_OK) rc = densities(r, err);
    if (rc == SH_OK) rc = times(r, err);
    if (rc != SH_OK) return rc;
    figures_histogram_of(r->distance_m, r->cloud.n, REPORT_SHOWN, &r->f.distances);
    figures_histogram_of_signed(r->points.along_m, r->cloud.n, REPORT_SHOWN, &r->f.along);
    report_judge(r);
    return SH_OK;
}

const struct scene_surface *report_worst_surface(const struct report *r)
{
    if (r->f.stats.points == 0) return NULL;
    const uint16_t label = cloud_surface(&r->cloud, r->site->scene, r->triangle, r->f.stats.worst);
    return label < r->site->n_surfaces ? site_surface(r->site, label) : NULL;
}

void report_free(struct report *r)
{
    free(r->georef);
    free(r->distance_m);
    free(r->triangle);
    free(r->f.station);
    free(r->f.head);
    free(r->f.times);
    free(r->f.gap_s);
    free(r->f.label);
    free(r->f.by_points);
    figures_density_free(&r->f.density);
    deviation_points_free(&r->points);
    cloud_free(&r->cloud);
    sites_free(&r->sites);
}
