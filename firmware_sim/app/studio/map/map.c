/* SPDX-License-Identifier: MIT */
/* scanhead map: a picture of the scene from above. The head scans it off line. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/mat3.h"
#include "core/newfile.h"
#include "core/scene_objects.h"
#include "core/studio/map.h"
#include "core/vec3.h"
#include "firmware_sim/app/app.h"
#include "firmware_sim/app/studio/map/field_lines.h"
#include "firmware_sim/app/studio/map/view.h"
#include "firmware_sim/app/studio/record/heads.h"
#include "firmware_sim/config/config.h"
#include "firmware_sim/config/places.h"

enum { BATCH = 256 };

struct map_run {
    struct app_input in;
    const char *output;
    double pixel_m;
    int quiet, perspective, open_edges;
    struct map_view_options view;
    struct map_view_plan plan;
    struct map_spec spec;
    struct map *map;
    const struct config *cfg; /* with the monitored fields */
    struct heads heads;
    uint32_t marked; /* stations that are in the map */
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
    double d[3];
    vec3_sub(p_prcs, run->origin_m, d);
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

/* Widens the area of the map by a place in prcs. */
static void include(struct map_run *run, const double p_prcs[3])
{
    struct map_spec *spec = &run->spec;
    double p[3];
    to_map(run, p_prcs, p);
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

/* The height is that of the head's origin: above the ground under a tripod or above the floor, where one was looked
 * for. Else it is z, or the height above the ellipsoid where the scene is in ECEF. */
static int add_station(struct map_run *run, const struct site_station *station, struct sh_err *err)
{
    const struct placement *at = &station->at;
    struct map_station mark = {.heading_rad = NAN};
    double p[3], ahead[3] = {at->rotation[1], at->rotation[4], at->rotation[7]}, forward[3];
    to_map(run, at->position_m, p);
    memcpy(forward, ahead, sizeof forward);
    if (run->turned) mat3_apply(run->to_enu, ahead, forward);
    mark.x_m = p[0];
    mark.y_m = p[1];
    if (hypot(forward[0], forward[1]) > 1e-6) mark.heading_rad = atan2(forward[0], forward[1]);
    snprintf(mark.name, sizeof mark.name, "%s", station->station->name);
    if (station->tripod.from != NULL && !isnan(station->tripod.head_m))
        snprintf(mark.height, sizeof mark.height, "%.2f m above the ground", station->tripod.head_m);
    else if (!isnan(at->floor_m))
        snprintf(mark.height, sizeof mark.height, "%.2f m above the floor", at->floor_m);
    else if (run->turned) /* z is that of the map, not of the scene */
        snprintf(mark.height, sizeof mark.height, "height %.2f m", at->place.height_m);
    else
        snprintf(mark.height, sizeof mark.height, "z %.2f m", p[2]);
    return map_add_station(run->map, &mark, err);
}

static int add_line(const struct map_run *run, enum map_line kind, const double a[3], const double b[3],
                    struct sh_err *err)
{
    double from[3], to[3];
    to_map(run, a, from);
    to_map(run, b, to);
    return map_add_line(run->map, kind, from, to, err);
}

static void warn_left_out(const struct map_run *run, enum map_line kind, const char *what)
{
    struct map_counts counts;
    map_get_counts(run->map, &counts);
    if (counts.lines_left_out[kind] > 0)
        sh_warn(&app_report_stderr, "map: %llu %s are not drawn; a map has up to %d of them",
                (unsigned long long)counts.lines_left_out[kind], what, (int)MAP_MAX_LINES);
}

static int add_field_line(void *ctx, const double a[3], const double b[3], struct sh_err *err)
{
    return add_line(ctx, MAP_FIELD, a, b, err);
}

/* Fields belong to links, and so to the scanner of head.station alone. */
static int each_field_line(struct map_run *run, uint32_t station, const struct placement *at, field_line *take,
                           struct sh_err *err)
{
    return config_serves(run->cfg, station) ? field_lines_each(run->cfg, at, take, run, err) : SH_OK;
}

/* Stations are marked here, one by one, since only the site of a station's own scanner has the height of the head. */
static int prepare(void *ctx, uint32_t station, struct sh_err *err)
{
    struct map_run *run = ctx;
    int rc = heads_prepare(&run->heads, station, err);
    for (; rc == SH_OK && run->marked < station; run->marked++) {
        const struct site_station *at = &heads_site(&run->heads)->station[run->marked];
        rc = add_station(run, at, err);
        if (rc == SH_OK) rc = each_field_line(run, run->marked, &at->at, add_field_line, err);
    }
    return rc;
}

/* Includes the corners of their bounding boxes, which are a little larger than the copies. */
static void include_copies(struct map_run *run, const struct scene_copied *of)
{
    for (uint32_t k = 0; k < of->n; k++)
        for (int corner = 0; corner < 8; corner++) {
            double v[3];
            for (int i = 0; i < 3; i++)
                v[i] = corner >> i & 1 ? of->copy[k].max_m[i] : of->copy[k].min_m[i];
            include(run, v);
        }
}

static int include_line(void *ctx, const double a[3], const double b[3], struct sh_err *err)
{
    (void)b;
    (void)err;
    include(ctx, a);
    return SH_OK;
}

static int create_map(struct map_run *run, const struct site *site, struct sh_err *err)
{
    const struct scene *scene = site->scene;
    struct map_spec *spec = &run->spec;
    *spec = (struct map_spec){{INFINITY, INFINITY}, {-INFINITY, -INFINITY}, run->pixel_m};
    int rc = choose_view(run, site, err);
    if (rc != SH_OK) return rc;
    for (uint32_t v = 0; v < scene->n_vertices && run->turned; v++)
        include(run, scene->vertex_m[v]);
    for (uint32_t i = 0; i < scene->n_copied && run->turned; i++)
        include_copies(run, &scene->copied[i]);
    if (!run->turned) {
        include(run, scene->min_m);
        include(run, scene->max_m);
    }
    for (uint32_t s = 0; s < site->n_stations; s++) {
        include(run, site->station[s].at.position_m);
        rc = each_field_line(run, s, &site->station[s].at, include_line, err);
        if (rc != SH_OK) return rc;
    }
    double span_m = fmax(spec->max_m[0] - spec->min_m[0], spec->max_m[1] - spec->min_m[1]);
    for (int i = 0; i < 2; i++) { /* a margin, so that nothing sticks to the border */
        spec->min_m[i] -= 0.03 * span_m;
        spec->max_m[i] += 0.03 * span_m;
    }
    return map_create(spec, &run->map, err);
}

static int add_edge(void *ctx, const double a[3], const double b[3], struct sh_err *err)
{
    return add_line(ctx, MAP_OPEN_EDGE, a, b, err);
}

/* Edges of what stands still are marked; those of bodies that move are not. */
static int mark_open_edges(struct map_run *run, const struct scene *scene, struct sh_err *err)
{
    const struct scene_open_edges edges = {run, add_edge};
    struct scene_objects objects;
    struct map_counts counts;
    if (!run->open_edges) return SH_OK;
    const int rc = scene_objects_find(scene, &edges, &app_report_seconds, &objects, err);
    scene_objects_free(&objects);
    warn_left_out(run, MAP_OPEN_EDGE, "open edges");
    map_get_counts(run->map, &counts);
    if (rc == SH_OK && !run->quiet)
        fprintf(stderr, "scanhead: %llu open edges drawn\n", (unsigned long long)counts.lines[MAP_OPEN_EDGE]);
    return rc;
}

static int write_map(struct map_run *run, uint32_t n_stations, struct sh_err *err)
{
    struct map_label *label = malloc(n_stations * sizeof *label);
    if (label == NULL) return sh_fail(err, SH_ENOMEM, "map: no memory for %u labels", n_stations);
    const uint32_t left_out = map_place_labels(run->map, label);
    free(label);
    if (left_out > 0)
        sh_warn(
            &app_report_stderr,
            "map: the names of %u of %u stations have no room; a smaller --pixel-m makes room, and an SVG has them as "
            "titles",
            left_out, n_stations);
    return app_ends_in(run->output, ".svg") ? map_write_svg(run->map, run->output, err)
                                            : map_write_png(run->map, run->output, err);
}

static int draw(struct config *cfg, void *ctx, struct sh_err *err)
{
    struct map_run *run = ctx;
    struct heads *heads = &run->heads;
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
    run->cfg = cfg;
    int rc = newfile_check(run->output, err);
    if (rc == SH_OK) rc = heads_load(cfg, heads, err);
    if (rc == SH_OK) rc = heads_open(heads, NULL, 0.0, &app_report_stderr, err);
    if (rc == SH_OK) options.last_station = heads->first->site->n_stations;
    if (rc == SH_OK) rc = create_map(run, heads->first->site, err);
    if (rc == SH_OK) rc = mark_open_edges(run, heads->first->site->scene, err);
    if (rc == SH_OK) rc = heads_record(heads, &options, &result, err);
    if (rc == SH_OK && app_interrupted()) rc = sh_fail(err, SH_EIO, "interrupted; nothing written");
    if (rc == SH_OK) warn_left_out(run, MAP_FIELD, "lines of monitored fields");
    if (rc == SH_OK) rc = write_map(run, heads->first->site->n_stations, err);
    if (rc == SH_OK && !run->quiet) {
        struct map_counts counts;
        map_get_counts(run->map, &counts);
        fprintf(stderr, "scanhead: %s: %llu points drawn, %llu outside of the area\n", run->output,
                (unsigned long long)counts.drawn, (unsigned long long)counts.outside);
    }
    map_free(run->map);
    heads_close(heads);
    return rc;
}

/* The map is in the scene's coordinates, whatever the configuration sends to its clients. output.layout is set only in
 * draw: as a setting it would be refused where a link's protocol forbids geo, although no link is opened. */
static int set_scene_crs(struct app_sets *sets)
{
    static const char *const SETS[] = {"output.crs=local", "output.utm_zone=0", "output.heights=ellipsoid"};
    int status = APP_OK;
    for (size_t i = 0; i < sizeof SETS / sizeof SETS[0] && status == APP_OK; i++)
        status = app_add_set(sets, SETS[i]);
    return status;
}

static int draw_view(struct config *cfg, void *ctx, struct sh_err *err)
{
    const struct map_run *run = ctx;
    return run->view.cloud != NULL ? map_view_cloud(cfg, run->view.cloud, &run->plan, err)
                                   : map_view_scan(cfg, &run->plan, err);
}

static int is_cloud(const char *path)
{
    return app_ends_in(path, ".ply") || app_ends_in(path, ".las");
}

static int run_view(struct map_run *run)
{
    struct sh_err err = {0};
    const char *operand = run->in.operand[0];
    int status = APP_OK;
    if (!app_ends_in(run->output, ".png"))
        return app_usage(&app_map, "-o %s: with --perspective it is an image; allowed is a name that ends in .png",
                         run->output);
    if (run->pixel_m > 0 || run->open_edges)
        return app_usage(&app_map, "%s: allowed for a map from above, not with --perspective",
                         run->open_edges ? "--open-edges" : "--pixel-m");
    if (map_view_read(&run->view, &run->plan, &err) != SH_OK) return app_usage(&app_map, "%s", err.text);
    run->plan.output = run->output;
    run->plan.quiet = run->quiet;
    if (is_cloud(operand)) {
        if (run->view.cloud != NULL)
            return app_usage(&app_map, "%s and --cloud %s: one cloud is shown at a time", operand, run->view.cloud);
        if (run->in.sets.n > 0)
            return app_usage(&app_map, "--set: %s is not a configuration; allowed with a CONFIG", operand);
        if (app_check_files(&run->in, NULL, &err) != SH_OK) return app_fail(&err);
        const int rc = map_view_cloud(NULL, operand, &run->plan, &err);
        return rc == SH_OK ? APP_OK : app_fail(&err);
    }
    if (run->view.cloud == NULL) status = set_scene_crs(&run->in.sets);
    return status == APP_OK ? app_with_config(&run->in, draw_view, run) : status;
}

static int map_run_command(int argc, char **argv)
{
    struct map_run run = {.view = map_view_default};
    int status = app_parse(&app_map, argc, argv, &run.in, &run);
    if (status != APP_GO_ON) return status;
    if (run.output == NULL) return app_usage(&app_map, "-o FILE.png or -o FILE.svg is needed");
    if (run.perspective) return run_view(&run);
    if (memcmp(&run.view, &map_view_default, sizeof run.view) != 0)
        return app_usage(
            &app_map,
            "options of the eye, sizes, colours and clouds need --perspective; a map from above takes -o, --pixel-m, "
            "--open-edges, --set and --quiet");
    if (is_cloud(run.in.operand[0]))
        return app_usage(&app_map, "%s is a point cloud; a map from above scans a CONFIG: add --perspective",
                         run.in.operand[0]);
    if (!app_ends_in(run.output, ".png") && !app_ends_in(run.output, ".svg"))
        return app_usage(&app_map, "-o %s: allowed are names that end in .png or .svg", run.output);
    status = set_scene_crs(&run.in.sets);
    return status == APP_OK ? app_with_config(&run.in, draw, &run) : status;
}

#define AT(member) offsetof(struct map_run, member)

/* clang-format off */
static const struct app_option OPTIONS[] = {
    {APP_TEXT, "output", "FILE", .letter = 'o', .at = AT(output), .file = APP_WRITES,
     .help = "file to write: .png, or .svg (points as an image, everything else as vectors)"},
    {APP_NUMBER, "pixel-m", "M", .min = 1e-4, .max = 1e4, .at = AT(pixel_m),
     .help = "side of a pixel; default: 1200 pixels on the longer side"},
    {APP_FLAG, "open-edges", NULL, .at = AT(open_edges),
     .help = "mark open edges of bodies in red, as counted by check --scene"},
    {APP_FLAG, "perspective", NULL, .at = AT(perspective),
     .help = "make a picture from a viewpoint, shaded by depth; the options below need it"},
    {APP_TEXT, "cloud", "FILE", .at = AT(view.cloud), .file = APP_READS,
     .help = "show this recording (.ply, .las) in place of a scan; CONFIG gives its place in the scene, and the "
             "stations"},
    {APP_TEXT, "from", "DIRECTION", .at = AT(view.from), OPTION_CHOICES(map_view_winds),
     .help = "side from which to look: north, north-east ..., or degrees clockwise from north (default south-west); "
             "far enough to see everything"},
    {APP_NUMBER, "elevation-deg", "DEG", .min = -89, .max = 89, .at = AT(view.elevation_deg),
     .help = "elevation of the eye above the horizon (default 40)"},
    {APP_TEXT, "eye", "X,Y,Z", .at = AT(view.eye), .help = "place of the eye, in metres, in place of --from"},
    {APP_TEXT, "look-at", "X,Y,Z", .at = AT(view.look_at),
     .help = "place in the picture's middle (default: the middle of the points)"},
    {APP_NUMBER, "fov-deg", "DEG", .min = 1, .max = 160, .at = AT(view.fov_deg),
     .help = "field of view, across the width (default 40)"},
    {APP_TEXT, "size", "WxH", .at = AT(view.size), .help = "size of the picture in pixels, 16777216 in all at most, as "
                                                           "in 4096x4096 (default 1200x800)"},
    {APP_TEXT, "colour", "WHAT", .at = AT(view.colour), OPTION_CHOICES(map_view_colours),
     .help = "colours to show: height (default), range, reflectance, label, station, rgb (of a recording, or "
             "output.colour)"},
    {APP_TEXT, "limits", "LOW,HIGH", .at = AT(view.limits),
     .help = "limits of the colours of height or range (default: those of the points, without 0.5 % at each end)"},
    {APP_NUMBER, "below", "Z", .min = -1e9, .max = 1e9, .at = AT(view.below_m), .help = "only points below this z"},
    {APP_NUMBER, "above", "Z", .min = -1e9, .max = 1e9, .at = AT(view.above_m), .help = "only points above this z"},
    {APP_NUMBER, "point-m", "M", .min = 0, .max = 1000, .at = AT(view.point_m),
     .help = "width of a point in the scene (default: 1/700 of the scene's longest side)"},
    {APP_NUMBER, "point-px", "PX", .min = 0.5, .max = 32, .at = AT(view.point_px),
     .help = "least width of a point in the picture (default 1.5)"},
    {APP_NUMBER, "shade", "S", .min = 0, .max = 4, .at = AT(view.shade),
     .help = "strength of the shading: 0 none, 1 usual"},
    OPTION_SET,
    {APP_FLAG, "quiet", NULL, .at = AT(quiet), .help = "no progress"},
    OPTION_END
};
/* clang-format on */

const struct app_command app_map = {
    .name = "map",
    .operand = {"CONFIG|CLOUD"},
    .needs = "-o FILE",
    .summary = "scan map of the stations, from above; or points in perspective",
    .options = OPTIONS,
    .notes =
        "Scans one frame from each station off line and draws the points. A pixel is darker where more heights were\n"
        "hit, as on walls. Its hue shows the height of its lowest point. The area is that of the scene, the stations\n"
        "and the monitored fields. Each station has its name, its height and a tick where its heading points. The\n"
        "height is that of its head above the ground or floor where it has a tripod or instrument_height_m; else it\n"
        "is z, or the height above the ellipsoid of a scene in ECEF.\n"
        "\n"
        "With --perspective the points are shown as seen from a place. Hidden ones are removed, and shading by depth\n"
        "(eye-dome lighting) gives them shape. CLOUD, or --cloud FILE with a CONFIG, is a recording.\n",
    .run = map_run_command,
};
