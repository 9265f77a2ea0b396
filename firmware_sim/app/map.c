/* scanhead map: a picture of the scene from above. The head scans it off line. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "core/map.h"
#include "core/mat3.h"
#include "core/vec3.h"
#include "firmware_sim/app/app.h"
#include "firmware_sim/app/offline.h"
#include "firmware_sim/app/recording.h"

enum { BATCH = 256 };

struct map_run {
    struct app_input in;
    const char *output;
    double pixel_m;
    int quiet;
    struct map *map;
    struct offline offline;
    /* 1: a scene in ECEF, drawn in east, north, up of station 1. 0: drawn along the axes of the scene. */
    int turned;
    double origin_m[3], to_enu[9];
    struct scanhead_point point[BATCH];
    double x[BATCH], y[BATCH], z[BATCH];
};

static void to_map(const struct map_run *run, const double p_prcs[3], double p[3])
{
    memcpy(p, p_prcs, 3 * sizeof *p);
    if (!run->turned) return;
    const double d[3] = {p_prcs[0] - run->origin_m[0], p_prcs[1] - run->origin_m[1], p_prcs[2] - run->origin_m[2]};
    mat3_apply(run->to_enu, d, p);
}

static int add_frame(void *ctx, struct scanhead *sh, const struct scanhead_frame *frame, struct sh_err *err)
{
    struct map_run *run = ctx;
    if (frame->type != SCANHEAD_POINTS) return SH_OK;
    for (uint32_t first = 0; first < frame->n_points;) {
        int n = scanhead_points(sh, frame, first, run->point, BATCH);
        if (n <= 0) return sh_fail(err, SH_ESTATE, "map: %s", scanhead_error(sh));
        for (int i = 0; i < n; i++) {
            double p[3];
            to_map(run, (const double[3]){run->point[i].x, run->point[i].y, run->point[i].z}, p);
            VEC3_SET(*run, i, p);
        }
        map_add_points(run->map, (size_t)n, run->x, run->y, run->z);
        first += (uint32_t)n;
    }
    return SH_OK;
}

static int prepare(void *ctx, uint32_t station, struct sh_err *err)
{
    struct map_run *run = ctx;
    return offline_prepare(&run->offline, station, &app_report_stderr, err);
}

static void include(struct map_spec *spec, const double p[3])
{
    for (int i = 0; i < 2; i++) {
        spec->min_m[i] = fmin(spec->min_m[i], p[i]);
        spec->max_m[i] = fmax(spec->max_m[i], p[i]);
    }
}

static int choose_view(struct map_run *run, const struct site *site, struct sh_err *err)
{
    const struct geoframe *frame = &site->anchor.frame;
    run->turned = site->anchor.known && frame->kind == GEOFRAME_ECEF;
    if (!run->turned) return SH_OK;
    memcpy(run->origin_m, site->station[0].at.position_m, sizeof run->origin_m);
    return geoframe_to_enu(frame, run->origin_m, run->to_enu, err);
}

static int create_map(struct map_run *run, const struct site *site, struct sh_err *err)
{
    const struct scene *scene = site->scene;
    struct map_spec spec = {{INFINITY, INFINITY}, {-INFINITY, -INFINITY}, run->pixel_m};
    double p[3], mark[3];
    int rc = choose_view(run, site, err);
    if (rc != SH_OK) return rc;
    for (uint32_t v = 0; v < scene->n_vertices && run->turned; v++) {
        to_map(run, scene->vertex_m[v], p);
        include(&spec, p);
    }
    if (!run->turned) {
        include(&spec, scene->min_m);
        include(&spec, scene->max_m);
    }
    for (uint32_t s = 0; s < site->n_stations; s++) {
        to_map(run, site->station[s].at.position_m, mark);
        include(&spec, mark);
    }
    double span_m = fmax(spec.max_m[0] - spec.min_m[0], spec.max_m[1] - spec.min_m[1]);
    for (int i = 0; i < 2; i++) { /* a margin, so that nothing sticks to the border */
        spec.min_m[i] -= 0.03 * span_m;
        spec.max_m[i] += 0.03 * span_m;
    }
    rc = map_create(&spec, &run->map, err);
    for (uint32_t s = 0; s < site->n_stations && rc == SH_OK; s++) {
        to_map(run, site->station[s].at.position_m, mark);
        rc = map_add_station(run->map, mark[0], mark[1], err);
    }
    return rc;
}

static int draw(struct config *cfg, void *ctx, struct sh_err *err)
{
    struct map_run *run = ctx;
    struct offline *offline = &run->offline;
    struct recording_result result;
    struct recording_options options = {.first_station = 1,
                                        .frames = 1,
                                        .progress = !run->quiet,
                                        .report = &app_report_stderr,
                                        .prepare = prepare,
                                        .frame = add_frame,
                                        .ctx = run,
                                        .interrupted = app_interrupted};
    app_catch_signals();
    cfg->output.layout = LINE_GEO;
    int rc = offline_open(cfg, 0.0, &app_report_stderr, offline, err);
    if (rc == SH_OK) options.last_station = offline->site->n_stations;
    if (rc == SH_OK) rc = create_map(run, offline->site, err);
    if (rc == SH_OK) rc = recording_run(offline->sh, &options, &result, err);
    if (rc == SH_OK && app_interrupted()) rc = sh_fail(err, SH_EIO, "interrupted; nothing written");
    if (rc == SH_OK) rc = map_write_png(run->map, run->output, err);
    if (rc == SH_OK && !run->quiet) {
        struct map_counts counts;
        map_get_counts(run->map, &counts);
        fprintf(stderr, "scanhead: %s: %llu points drawn, %llu outside of the area\n", run->output,
                (unsigned long long)counts.drawn, (unsigned long long)counts.outside);
    }
    map_free(run->map);
    offline_close(offline);
    return rc;
}

/* The map is in the scene's frame, whatever the configuration sends to its clients. The layout is no setting here:
 * protocols of links forbid geo, and no link is opened. */
static int set_frame(struct app_sets *sets)
{
    static const char *const SETS[] = {"output.crs=local", "output.utm_zone=0", "output.heights=ellipsoid"};
    int status = APP_OK;
    for (size_t i = 0; i < sizeof SETS / sizeof SETS[0] && status == APP_OK; i++)
        status = app_add_set(sets, SETS[i]);
    return status;
}

static int run(int argc, char **argv)
{
    struct map_run run = {0};
    int status = app_parse(&app_map, argc, argv, &run.in, &run);
    if (status != APP_GO_ON) return status;
    if (run.output == NULL) return app_usage(&app_map, "-o FILE.png is needed");
    if (!app_ends_in(run.output, ".png"))
        return app_usage(&app_map, "-o %s: it would hold a PNG; allowed is a name that ends in .png", run.output);
    status = set_frame(&run.in.sets);
    return status == APP_OK ? app_with_config(&run.in, draw, &run) : status;
}

#define AT(member) offsetof(struct map_run, member)

/* clang-format off */
static const struct app_option OPTIONS[] = {
    {APP_TEXT, "output", "FILE.png", .letter = 'o', .at = AT(output), .help = "where to write"},
    {APP_NUMBER, "pixel-m", "M", .min = 1e-4, .max = 1e4, .at = AT(pixel_m),
     .help = "side of a pixel; default: 1200 pixels on the longer side"},
    OPTION_SET,
    {APP_FLAG, "quiet", NULL, .at = AT(quiet), .help = "no progress"},
    OPTION_END
};
/* clang-format on */

const struct app_command app_map = {
    .name = "map",
    .operand = {"CONFIG"},
    .needs = "-o FILE.png",
    .summary = "scan map of the stations, from above",
    .options = OPTIONS,
    .notes =
        "Scans one frame from each station off line and draws the points. A pixel is darker where more heights were\n"
        "hit, as on walls. Its hue shows the height of its lowest point. The area is that of the scene and the\n"
        "stations.\n",
    .run = run,
};
