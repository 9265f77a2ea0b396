/* SPDX-License-Identifier: MIT */
/* The description of a recording, as JSON. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "core/angle.h"
#include "firmware_sim/app/studio/page_json.h"
#include "firmware_sim/app/studio/view/encode.h"

static void put_frame(const struct viewed *v, struct json *json)
{
    const int64_t code = v->points.epsg;
    char epsg[32];
    snprintf(epsg, sizeof epsg, "EPSG:%lld", (long long)code);
    json_string(json, "frame", v->turned ? "enu" : code == 0 ? "scene" : code > 0 ? epsg : "unknown");
    json_string(json, "crs", v->turned ? epsg : NULL);
    if (!v->turned) {
        json_string(json, "place", NULL);
        return;
    }
    json_open_object(json, "place");
    json_double(json, "lat_deg", v->lat_deg);
    json_double(json, "lon_deg", v->lon_deg);
    json_double(json, "height_m", v->height_m);
    json_close_object(json);
}

static void put_column(struct json *json, const struct view_column *c, double low, double high)
{
    json_open_object(json, NULL);
    json_string(json, "name", c->name);
    json_string(json, "type", view_type_name(c->type));
    json_uint(json, "components", c->components);
    json_string(json, "unit", c->unit);
    json_double(json, "min", low);
    json_double(json, "max", high);
    json_close_object(json);
}

static void put_columns(const struct viewed *v, struct json *json)
{
    size_t size;
    json_open_array(json, "columns");
    put_column(json, &view_position, (double)NAN, (double)NAN);
    for (int c = 0; c < CLOUD_COLUMNS; c++)
        if (cloud_array(&v->points, (enum cloud_column)c, &size) != NULL)
            put_column(json, &view_columns[c], v->low[c], v->high[c]);
    json_close_array(json);
}

static void put_meshes(const struct viewed *v, struct json *json)
{
    json_bool(json, "has_mesh", v->n_meshes > 0);
    json_string(json, "why_no_mesh", v->n_meshes > 0 ? NULL : v->why_no_mesh);
    json_open_array(json, "meshes");
    for (size_t i = 0; i < v->n_meshes; i++) {
        const struct viewed_mesh *m = &v->mesh[i];
        json_open_object(json, NULL);
        json_uint(json, "scan", i + 1);
        json_uint(json, "station", m->station);
        json_uint(json, "station_scan", m->scan);
        json_uint(json, "sweep", m->sweep);
        json_uint(json, "first_point", m->first_point);
        json_uint(json, "points", m->n_points);
        json_uint(json, "triangles", m->n_faces);
        json_uint(json, "edges", m->n_edges);
        json_double(json, "mean_edge_m", m->mean_edge_m);
        json_uint(json, "flat", m->n_flat);
        json_close_object(json);
    }
    json_close_array(json);
}

static void put_recording(const struct viewed *v, struct json *json)
{
    json_open_object(json, "recording");
    json_string(json, "file", basename(v->path));
    json_string(json, "format", v->format);
    put_frame(v, json);
    json_uint(json, "points", v->points.n);
    json_uint(json, "shots_without_echo", v->n_empty);
    json_uint(json, "left_out", v->n_left_out);
    json_bool(json, "complete", v->complete);
    json_double(json, "t0_s", v->t0_s);
    put_columns(v, json);
    json_open_object(json, "limits");
    json_uint(json, "points_per_answer", VIEW_MAX_POINTS);
    json_uint(json, "triangles_per_answer", VIEW_MAX_TRIANGLES);
    json_uint(json, "sparse_points", VIEW_MAX_SPARSE);
    json_close_object(json);
    put_meshes(v, json);
    json_close_object(json);
}

/* Maker, model and serial number are the first three words of *IDN?'s answer. */
static void put_maker(const struct viewed *v, struct json *json)
{
    static const char *const keys[] = {"maker", "model", "serial"};
    char idn[sizeof v->idn], *p = idn;
    memcpy(idn, v->idn, sizeof idn);
    for (int i = 0; i < 3; i++) {
        char *word = p != NULL ? strsep(&p, ",") : NULL;
        json_string(json, keys[i], word != NULL && *word != '\0' ? word : NULL);
    }
    json_string(json, "profile", v->profile[0] != '\0' ? v->profile : NULL);
    json_string(json, "config", NULL);
}

static void put_station(const struct viewed_station *s, struct json *json)
{
    const double none = (double)NAN; /* null */
    json_open_object(json, NULL);
    json_uint(json, "number", s->number);
    json_string(json, "name", NULL);
    json_double(json, "x_m", s->placed ? s->p_m[0] : none);
    json_double(json, "y_m", s->placed ? s->p_m[1] : none);
    json_double(json, "z_m", s->placed ? s->p_m[2] : none);
    json_double(json, "heading_deg", s->placed ? angle_deg(s->heading_rad) : none);
    json_double(json, "pitch_deg", s->placed ? angle_deg(s->pitch_rad) : none);
    json_double(json, "roll_deg", s->placed ? angle_deg(s->roll_rad) : none);
    json_string(json, "tripod", NULL);
    json_bool(json, "served", 1);
    json_close_object(json);
}

void view_put_head(struct json *json, const void *ctx)
{
    const struct viewed *v = ctx;
    json_open_object(json, NULL);
    put_recording(v, json);
    put_maker(v, json);
    json_open_array(json, "stations");
    for (size_t i = 0; i < v->n_stations; i++)
        put_station(&v->station[i], json);
    json_close_array(json);
    json_open_array(json, "surfaces");
    for (size_t i = 0; i < v->n_surfaces; i++) {
        page_put_surface(json, v->surface[i].label, v->surface[i].object, v->surface[i].material);
    }
    json_close_array(json);
    page_put_bounds(json, v->min_m, v->max_m);
    page_put_vector(json, "origin", v->origin_m);
    json_close_object(json);
}
