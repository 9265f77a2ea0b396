/* SPDX-License-Identifier: MIT */
#include "firmware_sim/app/studio/map/view.h"

#include <math.h>
#include <stdlib.h>

#include "core/grow.h"
#include "core/studio/cloud.h"
#include "core/vec3.h"
#include "firmware_sim/app/app.h"
#include "firmware_sim/app/studio/map/view_inside.h"
#include "firmware_sim/app/studio/record/heads.h"
#include "firmware_sim/config/config.h"

/* ---- a scan */

struct scanning {
    struct picturing *p;
    struct heads heads;
    struct scanhead_point *point; /* of the last frame of points, [room] */
    struct scanhead_colour *colour;
    size_t point_room, colour_room;
    uint32_t n_points;
};

static int wants_colours(const struct scanning *s)
{
    return s->p->plan->colour == MAP_VIEW_RGB;
}

static void add_points(struct scanning *s, uint32_t station)
{
    for (uint32_t i = 0; i < s->n_points; i++) {
        const struct scanhead_point *from = &s->point[i];
        const uint8_t rgb[3] = {s->colour != NULL ? s->colour[i].red : 0, s->colour != NULL ? s->colour[i].green : 0,
                                s->colour != NULL ? s->colour[i].blue : 0};
        const struct picturing_figures f = {from->range_m, from->reflectance_db, from->label, (uint16_t)station, rgb};
        picturing_add(s->p, (const double[3]){from->x, from->y, from->z}, &f);
    }
}

static int keep_points(struct scanning *s, struct scanhead *sh, const struct scanhead_frame *frame, struct sh_err *err)
{
    if (!grow(&s->point, &s->point_room, frame->n_points, sizeof *s->point))
        return sh_fail(err, SH_ENOMEM, "map: no memory for %u points", frame->n_points);
    const int n = scanhead_points(sh, frame, 0, s->point, frame->n_points);
    s->n_points = n > 0 ? (uint32_t)n : 0;
    return n == (int)frame->n_points ? SH_OK : sh_fail(err, SH_ESTATE, "map: %s", scanhead_error(sh));
}

static int keep_colours(struct scanning *s, struct scanhead *sh, const struct scanhead_frame *frame, struct sh_err *err)
{
    if (!grow(&s->colour, &s->colour_room, s->n_points, sizeof *s->colour))
        return sh_fail(err, SH_ENOMEM, "map: no memory for %u colours", s->n_points);
    const int n = scanhead_colours(sh, frame, 0, s->colour, s->n_points);
    return n == (int)s->n_points ? SH_OK : sh_fail(err, SH_ESTATE, "map: %s", scanhead_error(sh));
}

/* Colours come in a frame after that of their points. */
static int add_frame(void *ctx, struct scanhead *sh, const struct scanhead_frame *frame, struct sh_err *err)
{
    struct scanning *s = ctx;
    struct scanhead_info info;
    int rc = SH_OK;
    if (frame->type == SCANHEAD_POINTS) rc = keep_points(s, sh, frame, err);
    if (frame->type == SCANHEAD_COLOURS && wants_colours(s)) rc = keep_colours(s, sh, frame, err);
    if (rc != SH_OK || frame->type != (wants_colours(s) ? SCANHEAD_COLOURS : SCANHEAD_POINTS)) return rc;
    scanhead_get_info(sh, &info);
    add_points(s, info.station);
    return SH_OK;
}

static int prepare(void *ctx, uint32_t station, struct sh_err *err)
{
    struct scanning *s = ctx;
    return heads_prepare(&s->heads, station, err);
}

static void include_stations(const struct site *site, struct picturing_bounds *b)
{
    for (uint32_t s = 0; s < site->n_stations; s++)
        picturing_include(b, site->station[s].at.position_m);
}

static int check_up(const struct site *site, struct sh_err *err)
{
    if (!site->anchor.known || site->anchor.frame.kind != GEOFRAME_ECEF) return SH_OK;
    return sh_fail(err, SH_EINPUT,
                   "%s: scene.anchor: the z axis of a scene in ECEF is not up, but --perspective needs that",
                   site->cfg->file);
}

static int scan(struct scanning *s, struct config *cfg, struct sh_err *err)
{
    struct recording_result result;
    struct recording_options options = {.first_station = 1,
                                        .frames = 1,
                                        .progress = !s->p->plan->quiet,
                                        .report = &app_report_stderr,
                                        .prepare = prepare,
                                        .frame = add_frame,
                                        .ctx = s,
                                        .interrupted = app_interrupted};
    struct picturing_bounds bounds;
    app_catch_signals();
    cfg->output.layout = LINE_GEO;
    int rc = heads_load(cfg, &s->heads, err);
    if (rc == SH_OK) rc = heads_open(&s->heads, NULL, 0.0, &app_report_stderr, err);
    if (rc != SH_OK) return rc;
    const struct site *site = s->p->site = s->heads.first->site;
    vec3_bound_nothing(bounds.min_m, bounds.max_m);
    picturing_include(&bounds, site->scene->min_m);
    picturing_include(&bounds, site->scene->max_m);
    include_stations(site, &bounds);
    options.last_station = site->n_stations;
    rc = check_up(site, err);
    if (rc == SH_OK) rc = picturing_look(s->p, &bounds, err);
    if (rc == SH_OK) rc = heads_record(&s->heads, &options, &result, err);
    if (rc == SH_OK && app_interrupted()) rc = sh_fail(err, SH_EIO, "interrupted; nothing written");
    return rc == SH_OK ? picturing_finish(s->p, err) : rc;
}

int map_view_scan(struct config *cfg, const struct map_view_plan *plan, struct sh_err *err)
{
    struct scanning *s = calloc(1, sizeof *s);
    if (s == NULL) return sh_fail(err, SH_ENOMEM, "no memory for a scan");
    int rc = picturing_begin(plan, &s->p, err);
    if (rc == SH_OK && plan->colour == MAP_VIEW_RGB && cfg->output.colour == COLOUR_NONE)
        rc = sh_fail(err, SH_EINPUT,
                     "--colour rgb: the scan has no colours; set output.colour, as with --set output.colour=texture");
    if (rc == SH_OK) rc = scan(s, cfg, err);
    heads_close(&s->heads);
    if (s->p != NULL) picturing_end(s->p);
    free(s->point);
    free(s->colour);
    free(s);
    return rc;
}

/* ---- a recorded cloud */

struct showing {
    struct picturing *p;
    struct cloud cloud;
    struct site *site;
    const char *path;
};

/* Points of the geo layout are in output.crs; they are brought to the scene's frame. */
static int to_scene(struct showing *s, const struct config *cfg, struct sh_err *err)
{
    const struct site *site = s->site;
    const struct georef **georef = calloc(site->n_stations, sizeof *georef);
    struct cloud_site of = {.georef = cfg->output.layout == LINE_GEO ? georef : NULL,
                            .n_stations = site->n_stations,
                            .threads = config_threads(cfg)};
    struct sh_err why = {0};
    if (georef == NULL) return sh_fail(err, SH_ENOMEM, "no memory for %u stations", site->n_stations);
    for (uint32_t i = 0; i < site->n_stations; i++)
        georef[i] = site->station[i].georef;
    const int rc = cloud_into_scene(&s->cloud, &of, &app_report_seconds, &why);
    free(georef);
    return rc == SH_OK ? SH_OK : sh_fail(err, rc, "%s: %.300s", s->path, why.text);
}

static int check_columns(const struct showing *s, struct sh_err *err)
{
    static const char *const names[] = {"", "range", "reflectance", "label", "station", "red, green and blue"};
    const struct cloud *c = &s->cloud;
    const enum map_view_colour colour = s->p->plan->colour;
    const int has[] = {
        1, c->range_m != NULL, c->reflectance_db != NULL, c->label != NULL, c->station != NULL, c->rgb != NULL};
    if (c->n == 0) return sh_fail(err, SH_EINPUT, "%s: there are no points in it", s->path);
    if (!has[colour]) return sh_fail(err, SH_EINPUT, "%s: its points have no %s for --colour", s->path, names[colour]);
    if (s->site == NULL && (c->epsg == 4978 || c->epsg == 4979))
        return sh_fail(err, SH_EINPUT,
                       "%s: the z axis of points in %s is not up: use scanhead map CONFIG --perspective --cloud %s",
                       s->path, c->epsg == 4978 ? "ECEF" : "degrees", s->path);
    return SH_OK;
}

static int show(struct showing *s, struct config *cfg, struct sh_err *err)
{
    struct picturing_bounds bounds;
    app_catch_signals();
    int rc = cloud_read_columns(s->path, 1u << CLOUD_RANGE | 1u << CLOUD_REFLECTANCE | 1u << CLOUD_RGB,
                                &app_report_seconds, &s->cloud, err);
    if (rc == SH_OK && cfg != NULL) rc = site_load(cfg, &app_report_stderr, &s->site, err);
    s->p->site = s->site;
    if (rc == SH_OK) rc = check_columns(s, err);
    if (rc == SH_OK && s->site != NULL) rc = check_up(s->site, err);
    if (rc == SH_OK && s->site != NULL) rc = to_scene(s, cfg, err);
    if (rc != SH_OK) return rc;
    const struct cloud *c = &s->cloud;
    vec3_bound_nothing(bounds.min_m, bounds.max_m);
    for (size_t i = 0; i < c->n; i++)
        picturing_include(&bounds, c->xyz_m[i]);
    if (!(bounds.max_m[0] >= bounds.min_m[0]))
        return sh_fail(err, SH_EINPUT, "%s: it has no points, only %zu shots without echo", s->path, c->n);
    if (s->site != NULL) include_stations(s->site, &bounds);
    rc = picturing_look(s->p, &bounds, err);
    for (size_t i = 0; i < c->n && rc == SH_OK; i++) {
        const struct picturing_figures f = {
            .range_m = c->range_m != NULL ? (double)c->range_m[i] : (double)NAN,
            .refl_db = c->reflectance_db != NULL ? (double)c->reflectance_db[i] : (double)NAN,
            .label = c->label != NULL ? c->label[i] : CLOUD_LABEL_NONE,
            .station = c->station != NULL ? c->station[i] : 1,
            .rgb = c->rgb != NULL ? c->rgb[i] : NULL,
        };
        picturing_add(s->p, c->xyz_m[i], &f);
        if ((i & 0xffff) == 0) sh_progress(&app_report_seconds, "drawing the points", (double)i / (double)c->n);
        if ((i & 0xffff) == 0) rc = sh_check_stop(&app_report_seconds, err);
    }
    return rc == SH_OK ? picturing_finish(s->p, err) : rc;
}

int map_view_cloud(struct config *cfg, const char *cloud, const struct map_view_plan *plan, struct sh_err *err)
{
    struct showing s = {.path = cloud};
    int rc = picturing_begin(plan, &s.p, err);
    if (rc != SH_OK) return rc;
    rc = show(&s, cfg, err);
    picturing_end(s.p);
    cloud_free(&s.cloud);
    site_free(s.site);
    return rc;
}
