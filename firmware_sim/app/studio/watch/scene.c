/* SPDX-License-Identifier: MIT */
/* /scene, /head and /plan: the coarse scene, the head and its stations, its plan. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/bytes.h"
#include "core/mat3.h"
#include "core/studio/decimate.h"
#include "core/vec3.h"
#include "drivers/protocol/cola_field.h"
#include "firmware_sim/app/studio/page_json.h"
#include "firmware_sim/app/studio/watch/inside.h"
#include "firmware_sim/config/config.h"
#include "firmware_sim/site/plan_rows.h"

enum { PLAN_LEN = 512, HEAD_BYTES = 40, VERTEX_BYTES = 12, TRIANGLE_BYTES = 12, VERSION = 1 };
/* Each body that moves gets up to a tenth of the triangles that the scene may have, but up to DECIMATE_LEAST in any
 * case. */
enum { BODY_PART = 10 };

/* ---- /scene */

struct parts {
    struct decimated part[1 + CAST_MAX_MOVERS];
    uint32_t n;
};

static int make_part(const struct scene *scene, uint32_t most, const struct sh_report *report, struct parts *parts,
                     struct sh_err *err)
{
    const struct decimate_mesh mesh = {(const double(*)[3])scene->vertex_m, scene->n_vertices,
                                       (const uint32_t(*)[3])scene->triangle, scene->n_triangles};
    if (most < DECIMATE_LEAST) most = DECIMATE_LEAST;
    return decimate(&mesh, most, report, &parts->part[parts->n++], err);
}

static int make_parts(const struct watch *w, struct parts *parts, struct sh_err *err)
{
    const struct site *site = w->site;
    const uint32_t most = w->options.scene_triangles;
    struct cast_setup setup;
    int rc = make_part(site->scene, most, w->options.report, parts, err);
    if (site->n_movers > 0) site_move(site, 0, 0.0, &setup);
    for (uint32_t k = 0; k < site->n_movers && rc == SH_OK; k++) {
        rc = make_part(site->mover[k].scene, most / BODY_PART, w->options.report, parts, err);
        struct decimated *m = &parts->part[k + 1];
        for (uint32_t v = 0; v < m->n_vertices && rc == SH_OK; v++) {
            double p[3];
            mat3_apply(setup.mover[k].rotation, m->vertex_m[v], p);
            vec3_add(p, setup.mover[k].shift_m, m->vertex_m[v]);
        }
    }
    return rc;
}

static int put_scene(struct watch *w, const struct parts *parts, struct sh_err *err)
{
    const struct scene *scene = w->site->scene;
    uint32_t n_vertices = 0, n_triangles = 0, first = 0;
    double origin_m[3];
    for (uint32_t k = 0; k < parts->n; k++) {
        n_vertices += parts->part[k].n_vertices;
        n_triangles += parts->part[k].n_triangles;
    }
    w->scene_len = HEAD_BYTES + (size_t)n_vertices * VERTEX_BYTES + (size_t)n_triangles * TRIANGLE_BYTES;
    char *to = w->scene_bytes = malloc(w->scene_len);
    if (to == NULL) return sh_fail(err, SH_ENOMEM, "no memory for the coarse scene");
    memcpy(to, "SHSC", 4);
    le_put32(to + 4, VERSION);
    le_put32(to + 8, n_vertices);
    le_put32(to + 12, n_triangles);
    for (int i = 0; i < 3; i++) {
        origin_m[i] = 0.5 * scene->min_m[i] + 0.5 * scene->max_m[i];
        le_put_double(to + 16 + 8 * i, origin_m[i]);
    }
    to += HEAD_BYTES;
    for (uint32_t k = 0; k < parts->n; k++)
        for (uint32_t v = 0; v < parts->part[k].n_vertices; v++)
            for (int i = 0; i < 3; i++, to += 4)
                le_put_float(to, (float)(parts->part[k].vertex_m[v][i] - origin_m[i]));
    for (uint32_t k = 0; k < parts->n; first += parts->part[k++].n_vertices)
        for (uint32_t t = 0; t < parts->part[k].n_triangles; t++)
            for (int i = 0; i < 3; i++, to += 4)
                le_put32(to, first + parts->part[k].triangle[t][i]);
    return SH_OK;
}

int watch_make_scene(struct watch *w, struct sh_err *err)
{
    struct parts parts = {.n = 0};
    int rc = make_parts(w, &parts, err);
    if (rc == SH_OK) rc = put_scene(w, &parts, err);
    for (uint32_t k = 0; k < parts.n; k++)
        decimated_free(&parts.part[k]);
    return rc;
}

int watch_get_scene(const struct watch *w, struct web_body *out, struct sh_err *err)
{
    *out = (struct web_body){"application/octet-stream", malloc(w->scene_len), w->scene_len};
    if (out->bytes == NULL) return sh_fail(err, SH_ENOMEM, "no memory for the scene");
    memcpy(out->bytes, w->scene_bytes, w->scene_len);
    return SH_OK;
}

/* ---- JSON */

static void put_tripod(struct json *json, const struct device_station *s)
{
    if (!s->has_tripod) {
        json_string(json, "tripod", NULL);
        return;
    }
    json_open_object(json, "tripod");
    json_double(json, "leg_m", s->leg_m);
    json_double(json, "foot_radius_m", s->foot_radius_m);
    json_double(json, "height_m", s->height_m);
    json_double(json, "head_above_m", s->head_above_m);
    json_double(json, "legs_heading_deg", s->legs_heading_deg);
    json_close_object(json);
}

/* Outlines in the head's frame: x right, y forward, metres. */
static void put_fields(struct json *json, const struct config *cfg)
{
    double corner_m[COLA_SHAPE_CORNERS][2];
    struct cola_field field;
    json_open_array(json, "fields");
    for (uint32_t i = 0; i < cfg->n_fields; i++) {
        config_make_field(&cfg->field[i], &field);
        const uint32_t n = cola_shape_outline(&field.shape, corner_m);
        json_open_object(json, NULL);
        json_uint(json, "number", cfg->field[i].number);
        json_string(json, "name", field.name);
        json_open_array(json, "outline_m");
        for (uint32_t k = 0; k < n; k++) {
            json_double(json, NULL, corner_m[k][0]);
            json_double(json, NULL, corner_m[k][1]);
        }
        json_close_array(json);
        json_close_object(json);
    }
    json_close_array(json);
}

static void put_station(struct json *json, const struct watch *w, uint32_t i)
{
    struct device_station s;
    device_get_station(w->options.device, i, &s);
    json_open_object(json, NULL);
    json_uint(json, "number", i + 1);
    json_string(json, "name", s.name);
    json_double(json, "x_m", s.place.position_m[0]);
    json_double(json, "y_m", s.place.position_m[1]);
    json_double(json, "z_m", s.place.position_m[2]);
    json_double(json, "heading_deg", s.place.heading_deg);
    json_double(json, "pitch_deg", s.place.pitch_deg);
    json_double(json, "roll_deg", s.place.roll_deg);
    put_tripod(json, &s);
    json_bool(json, "served", s.served);
    json_close_object(json);
}

static void put_surfaces(struct json *json, const struct site *site)
{
    json_open_array(json, "surfaces");
    for (uint32_t i = 0; i < site->n_surfaces; i++) {
        const struct scene_surface *s = site_surface(site, i);
        page_put_surface(json, i, s->object, s->material);
    }
    json_close_array(json);
}

void watch_put_head(struct json *json, const void *ctx)
{
    static const char *const paces[] = {[PACE_REALTIME] = "realtime", [PACE_FAST] = "fast", [PACE_STEP] = "step"};
    const struct watch *w = ctx;
    const struct config *cfg = w->cfg;
    char run[24];
    snprintf(run, sizeof run, "%016llx", (unsigned long long)past_run(w->past));
    json_open_object(json, NULL);
    json_string(json, "run", run);
    json_string(json, "maker", cfg->profile.maker);
    json_string(json, "model", cfg->profile.model);
    json_string(json, "profile", cfg->profile.name);
    json_string(json, "serial", cfg->head.serial);
    json_string(json, "config", basename(cfg->file));
    json_string(json, "pace", paces[cfg->loop.pace]);
    json_bool(json, "previews", w->preview != NULL);
    json_open_array(json, "stations");
    for (uint32_t i = 0; i < w->site->n_stations; i++)
        put_station(json, w, i);
    json_close_array(json);
    put_fields(json, cfg);
    put_surfaces(json, w->site);
    page_put_bounds(json, w->site->scene->min_m, w->site->scene->max_m);
    json_close_object(json);
}

void watch_put_plan(struct json *json, const void *ctx)
{
    const struct watch *w = ctx;
    struct device_version *version;
    char text[PLAN_LEN];
    site_plan_text(device_hold_site(w->options.device, &version), text, sizeof text);
    device_give_back(version);
    json_open_object(json, NULL);
    json_string(json, "text", text);
    json_close_object(json);
}
