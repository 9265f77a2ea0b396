/* scanhead report: how far a recording's points lie from the scene of its configuration. */
#include <inttypes.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/cloud.h"
#include "core/mat3.h"
#include "firmware_sim/app/app.h"
#include "firmware_sim/base/clock.h"
#include "firmware_sim/site/site.h"

struct report {
    struct app_input in;
    const char *cloud_path;
    int json;
    double tolerance_m, max_m;
    int64_t reported_ns; /* when progress was reported last */
    struct config *cfg;
    struct site *site;
    const struct georef **georef; /* of each station */
    struct distance *index;
    struct distance *mover_index[CAST_MAX_MOVERS]; /* of each body that moves, in its own frame */
    struct cloud cloud;
    size_t ghosts;      /* points seen in mirrors: nothing is there, so they are left out */
    double *distance_m; /* per point */
    uint32_t *triangle;
    struct cloud_stats stats;
    struct cloud_coverage coverage;
};

/* core/analysis reports every piece of its work. A line a second is enough for a terminal, and none for short
 * work. */
static void report_each_second(void *ctx, const char *what, double fraction)
{
    struct report *r = ctx;
    const int64_t now_ns = clock_now_ns();
    if (now_ns - r->reported_ns < 1000000000) return;
    r->reported_ns = now_ns;
    sh_progress(&app_report_stderr, what, fraction);
}

/* Ghosts are counted, and become shots without echo. */
static void leave_out_ghosts(struct report *r)
{
    const struct site_detect *d = &r->site->detect;
    struct cloud *c = &r->cloud;
    for (size_t i = 0; d->ghost != NULL && c->label != NULL && i < c->n; i++) {
        if (c->label[i] < d->n_real || c->label[i] >= 2 * d->n_real) continue;
        c->label[i] = CLOUD_LABEL_NONE;
        for (int k = 0; k < 3; k++)
            c->xyz_m[i][k] = (double)NAN;
        r->ghosts++;
    }
}

static int load(struct report *r, struct sh_err *err)
{
    const struct sh_report progress = {r, app_report_stderr.warn, report_each_second, NULL};
    int rc = cloud_read(r->cloud_path, &progress, &r->cloud, err);
    if (rc == SH_OK) rc = site_load(r->cfg, &app_report_stderr, &r->site, err);
    if (rc == SH_OK) rc = distance_create(r->site->scene, &r->index, err);
    if (rc == SH_OK) leave_out_ghosts(r);
    for (uint32_t k = 0; rc == SH_OK && k < r->site->n_movers; k++)
        rc = distance_create(r->site->mover[k].scene, &r->mover_index[k], err);
    return rc;
}

/* Turns a point on a moving body into the body's own frame and gives the body's index. At a stop the body
 * stands still during the scan. */
static const struct distance *body_of(void *ctx, unsigned station, uint16_t label, double p_prcs[3])
{
    const struct report *r = ctx;
    const struct site *site = r->site;
    uint32_t k = 0, first = site->scene->n_surfaces;
    if (label < first || label >= site->n_surfaces) return NULL;
    for (; label >= first + site->mover[k].scene->n_surfaces; k++)
        first += site->mover[k].scene->n_surfaces;
    struct cast_setup setup;
    site_move(site, site_mover_time(site, station - 1, 0.0), &setup);
    const struct cast_mover *at = &setup.mover[k];
    const double d[3] = {p_prcs[0] - at->shift_m[0], p_prcs[1] - at->shift_m[1], p_prcs[2] - at->shift_m[2]};
    mat3_apply_transposed(at->rotation, d, p_prcs);
    return r->mover_index[k];
}

/* Without stops a body's place depends on the time of each point, which not every file has. */
static int check_bodies(const struct report *r, struct sh_err *err)
{
    const struct site *site = r->site;
    if (site->stop != NULL || site->n_movers == 0 || r->cloud.label == NULL) return SH_OK;
    for (size_t i = 0; i < r->cloud.n; i++)
        if (r->cloud.label[i] >= site->scene->n_surfaces && r->cloud.label[i] < site->n_surfaces)
            return sh_fail(err, SH_EINPUT,
                           "%s: point %zu is on %s, which moved during the scan; allowed are points of what stands "
                           "still, and scans with platform.kind: stops",
                           r->cloud_path, i + 1, site_surface(site, r->cloud.label[i])->object);
    return SH_OK;
}

static int compare(struct report *r, struct sh_err *err)
{
    const struct site *site = r->site;
    r->georef = calloc(site->n_stations, sizeof *r->georef);
    if (r->georef == NULL) return sh_fail(err, SH_ENOMEM, "no memory for %u stations", site->n_stations);
    for (uint32_t i = 0; i < site->n_stations; i++)
        r->georef[i] = site->station[i].georef;
    const struct cloud_site setup = {.index = r->index,
                                     .georef = r->cfg->output.layout == LINE_GEO ? r->georef : NULL,
                                     .n_stations = site->n_stations,
                                     .max_m = r->max_m,
                                     .threads = config_threads(r->cfg),
                                     .body = site->n_movers > 0 ? body_of : NULL,
                                     .body_ctx = r};
    const struct sh_report progress = {r, app_report_stderr.warn, report_each_second, NULL};
    struct sh_err why = {0};
    r->distance_m = malloc((r->cloud.n + 1) * sizeof *r->distance_m);
    r->triangle = malloc((r->cloud.n + 1) * sizeof *r->triangle);
    if (r->distance_m == NULL || r->triangle == NULL)
        return sh_fail(err, SH_ENOMEM, "no memory for %zu distances", r->cloud.n);
    int rc = check_bodies(r, err);
    if (rc != SH_OK) return rc;
    rc = cloud_compare(&r->cloud, &setup, &progress, r->distance_m, r->triangle, &why);
    if (rc == SH_OK) rc = cloud_cover(&r->cloud, site->scene, site->n_surfaces, r->triangle, &r->coverage, &why);
    if (rc != SH_OK) return sh_fail(err, rc, "%s: %.300s", r->cloud_path, why.text);
    cloud_stats(r->distance_m, r->cloud.n, r->tolerance_m, &r->stats);
    if (r->stats.points == 0)
        return sh_fail(err, SH_EINPUT, "%s: there are no points in it (%zu shots without echo)", r->cloud_path,
                       r->stats.empty);
    return SH_OK;
}

static const struct scene_surface *worst_surface(const struct report *r)
{
    uint16_t label = cloud_surface(&r->cloud, r->site->scene, r->triangle, r->stats.worst);
    return label != CLOUD_LABEL_NONE ? site_surface(r->site, label) : NULL;
}

static void print_length(const char *what, double m)
{
    if (isnan(m))
        printf("%-10s -\n", what);
    else if (m < 0.1)
        printf("%-10s %.6f mm\n", what, m * 1e3);
    else
        printf("%-10s %.6f m\n", what, m);
}

static void print_text(const struct report *r)
{
    const struct cloud_stats *s = &r->stats;
    const double *p = r->cloud.xyz_m[s->worst];
    const struct scene_surface *surface = worst_surface(r);
    printf("%-10s %zu\n%-10s %zu shots without echo\n", "points", s->points, "empty", s->empty - r->ghosts);
    if (r->ghosts != 0) printf("%-10s %zu points seen in mirrors, left out\n", "ghosts", r->ghosts);
    print_length("mean", s->mean_m);
    print_length("RMS", s->rms_m);
    print_length("50 %", s->p50_m);
    print_length("95 %", s->p95_m);
    print_length("99.9 %", s->p999_m);
    print_length("max", s->max_m);
    int flat = r->cloud.epsg == 4979 ? 11 : 6; /* degrees, or metres */
    printf("%-10s point %zu at %.*f %.*f %.6f", "worst", s->worst + 1, flat, p[0], flat, p[1], p[2]);
    if (surface != NULL) printf(" on %s | %s", surface->object, surface->material);
    printf("\n%-10s %zu farther than %g m\n", "beyond", s->beyond, r->tolerance_m);
    printf("%-10s %zu farther than %g m from everything\n", "far", s->far, r->max_m);
    printf("%-10s %" PRIu32 " of %" PRIu32 " surfaces, %" PRIu32 " of %" PRIu32 " triangles\n", "coverage",
           r->coverage.surfaces_hit, r->site->n_surfaces, r->coverage.triangles_hit, r->site->scene->n_triangles);
}

static void put_worst(struct json *json, const struct report *r)
{
    const struct cloud_stats *s = &r->stats;
    const struct scene_surface *surface = worst_surface(r);
    json_open_object(json, "worst");
    json_uint(json, "point", s->worst + 1);
    json_double(json, "x", r->cloud.xyz_m[s->worst][0]);
    json_double(json, "y", r->cloud.xyz_m[s->worst][1]);
    json_double(json, "z", r->cloud.xyz_m[s->worst][2]);
    json_string(json, "object", surface != NULL ? surface->object : NULL);
    json_string(json, "material", surface != NULL ? surface->material : NULL);
    json_close_object(json);
}

static void put_figures(struct json *json, const void *ctx)
{
    const struct report *r = ctx;
    const struct cloud_stats *s = &r->stats;
    json_open_object(json, NULL);
    json_uint(json, "points", s->points);
    json_uint(json, "empty", s->empty - r->ghosts);
    json_uint(json, "ghosts", r->ghosts);
    json_double(json, "mean_m", s->mean_m);
    json_double(json, "rms_m", s->rms_m);
    json_double(json, "p50_m", s->p50_m);
    json_double(json, "p95_m", s->p95_m);
    json_double(json, "p999_m", s->p999_m);
    json_double(json, "max_m", s->max_m);
    json_uint(json, "beyond", s->beyond);
    json_uint(json, "far", s->far);
    json_double(json, "tolerance_m", r->tolerance_m);
    json_uint(json, "surfaces_hit", r->coverage.surfaces_hit);
    json_uint(json, "surfaces", r->site->n_surfaces);
    json_uint(json, "triangles_hit", r->coverage.triangles_hit);
    json_uint(json, "triangles", r->site->scene->n_triangles);
    put_worst(json, r);
    json_close_object(json);
}

static int print_deviations(struct report *r, struct sh_err *err)
{
    int rc = load(r, err);
    if (rc == SH_OK) rc = compare(r, err);
    if (rc == SH_OK && r->json) rc = app_write_json("-", put_figures, r, err);
    if (rc == SH_OK && !r->json) print_text(r);
    if (rc == SH_OK && fflush(stdout) != 0) rc = sh_fail(err, SH_EIO, "standard output: writing failed");
    if (rc != SH_OK || r->stats.beyond == 0) return rc;
    return sh_fail(err, SH_ESTATE, "%s: %zu of %zu points are farther than %g m from the scene", r->cloud_path,
                   r->stats.beyond, r->stats.points, r->tolerance_m);
}

static int report(struct config *cfg, void *ctx, struct sh_err *err)
{
    struct report *r = ctx;
    r->cfg = cfg;
    r->reported_ns = clock_now_ns();
    r->cloud_path = r->in.operand[1];
    int rc = print_deviations(r, err);
    free(r->georef);
    free(r->distance_m);
    free(r->triangle);
    cloud_free(&r->cloud);
    distance_free(r->index);
    for (uint32_t k = 0; k < CAST_MAX_MOVERS; k++)
        distance_free(r->mover_index[k]);
    site_free(r->site);
    return rc;
}

static int run(int argc, char **argv)
{
    struct report r = {.tolerance_m = 0.001, .max_m = 10};
    int status = app_parse(&app_report, argc, argv, &r.in, &r);
    if (status == APP_GO_ON && r.tolerance_m > r.max_m)
        status = app_usage(&app_report, "--tolerance-m %g is more than --max-m %g", r.tolerance_m, r.max_m);
    return status == APP_GO_ON ? app_with_config(&r.in, report, &r) : status;
}

#define AT(member) offsetof(struct report, member)
#define FARTHEST_M 1e9 /* no scene is larger */

/* clang-format off */
static const struct app_option OPTIONS[] = {
    {APP_NUMBER, "tolerance-m", "T", .min = 0.0, .max = FARTHEST_M, .at = AT(tolerance_m),
     .help = "how far a point may be from the scene (default 0.001)"},
    {APP_NUMBER, "max-m", "M", .min = 1e-9, .max = FARTHEST_M, .at = AT(max_m),
     .help = "how far to look for the scene; a point farther than that counts as far, and fails (default 10)"},
    {APP_FLAG, "json", NULL, .at = AT(json),
     .help = "the figures as JSON, in metres: points, empty, ghosts, mean_m, rms_m, p50_m, p95_m, p999_m, max_m, "
             "beyond, far, tolerance_m, surfaces_hit, surfaces, triangles_hit, triangles, worst"},
    OPTION_SET,
    OPTION_END
};
/* clang-format on */

static const char NOTES[] =
    "CONFIG is the configuration of the recording: its scene, stations, output.crs and output.layout are used.\n"
    "CLOUD is a LAS file, or a PLY file with x, y, z and, where it has them, station, echo and label, as\n"
    "scanhead record writes both. Points without a station are taken to be of the first one. Three times NaN is\n"
    "a shot without echo.\n"
    "\n"
    "Each point's distance to the nearest triangle of the scene is measured in double precision. Points seen in\n"
    "mirrors lie where nothing is: with the mirrors in CONFIG (surfaces) they are left out. Mean, RMS, percentiles\n"
    "(nearest rank) and maximum are over all points that are not far. Percentiles are of the distances, which are\n"
    "never negative.\n"
    "\n"
    "Bodies that move stand where they stood at the station's stop (platform.kind: stops). Points on what moved\n"
    "during a scan are refused.\n"
    "\n"
    "Exit status: 0 all points are within the tolerance, 1 some are not, 2 wrong usage or input.\n";

const struct app_command app_report = {
    .name = "report",
    .operand = {"CONFIG", "CLOUD"},
    .summary = "distance of a recording's points from the configuration's scene",
    .options = OPTIONS,
    .notes = NOTES,
    .run = run,
};
