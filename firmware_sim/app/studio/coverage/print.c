/* SPDX-License-Identifier: MIT */
/* The figures of `scanhead coverage` as text and as JSON. */
#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "core/angle.h"
#include "firmware_sim/app/ranking.h"
#include "firmware_sim/app/studio/coverage/coverage.h"
#include "firmware_sim/app/studio/page_json.h"
#include "firmware_sim/config/places.h"

double coverage_percent(double part, double whole)
{
    return whole > 0.0 ? 100.0 * part / whole : 0.0;
}

static void print_area(const char *what, double area_m2, double whole_m2)
{
    printf("%-10s %12.3f m2 %8.3f %%\n", what, area_m2, coverage_percent(area_m2, whole_m2));
}

static void print_spread(const char *what, const struct coverage_spread *s, double unit, const char *unit_name)
{
    if (isnan(s->mean))
        printf("%-10s -\n", what);
    else
        printf("%-10s mean %.4g, 5 %% %.4g, 50 %% %.4g, 95 %% %.4g %s\n", what, s->mean * unit, s->p05 * unit,
               s->p50 * unit, s->p95 * unit, unit_name);
}

static void print_stations(const struct coverage_result *r)
{
    printf("\n%-16s %12s %8s %12s %8s %12s %12s\n", "station", "sees m2", "%", "alone m2", "%", "pulses", "with a hit");
    for (uint32_t i = 0; i < r->site->n_stations; i++) {
        const struct coverage_result_station *s = &r->station[i];
        printf("%-16s %12.3f %8.3f %12.3f %8.3f %12" PRIu64 " %12" PRIu64 "\n", r->site->station[i].station->name,
               s->seen_m2, coverage_percent(s->seen_m2, r->sums.area_m2), s->alone_m2,
               coverage_percent(s->alone_m2, r->sums.area_m2), s->pulses.cast, s->pulses.met);
    }
}

/* ---- by label, the largest unseen area first */

static double unseen_m2(const void *label, uint32_t i)
{
    const struct coverage_of_label *l = (const struct coverage_of_label *)label + i;
    return l->area_m2 - l->seen_m2;
}

static void print_labels(const struct coverage_result *r)
{
    const uint32_t n = r->site->scene->n_surfaces;
    uint32_t *order = ranking_make(n, unseen_m2, r->label);
    if (order == NULL) return;
    printf("\n%12s %12s %8s %12s  %s\n", "area m2", "unseen m2", "seen %", "points/m2", "object | material");
    for (uint32_t i = 0; i < n; i++) {
        const struct coverage_of_label *l = &r->label[order[i]];
        const struct scene_surface *s = &r->site->scene->surface[order[i]];
        char density[32] = "-", name[2 * SCENE_NAME_LEN + 8];
        snprintf(name, sizeof name, "%s | %s", s->object, s->material);
        sh_keep_line(name); /* a mesh may have any bytes */
        if (l->seen_m2 > 0.0) snprintf(density, sizeof density, "%.4g", (double)l->pulses / l->seen_m2);
        printf("%12.3f %12.3f %8.3f %12s  %s\n", l->area_m2, unseen_m2(r->label, order[i]),
               coverage_percent(l->seen_m2, l->area_m2), density, name);
    }
    free(order);
}

void coverage_print_text(const struct coverage_result *r)
{
    const struct coverage_sums *s = &r->sums;
    printf("%-10s %12.3f m2 in %" PRIu32 " cells of %g m\n", "surface", s->area_m2, s->cells, r->cell_m);
    if (s->duplicate_m2 > 0.0)
        printf("%-10s %12.3f m2 left out: faces with the corners of another one\n", "", s->duplicate_m2);
    if (s->silent_m2 > 0.0) printf("%-10s %12.3f m2 left out: not among scene.target\n", "", s->silent_m2);
    print_area("none", s->none_m2, s->area_m2);
    print_area("one", s->one_m2, s->area_m2);
    print_area("several", s->several_m2, s->area_m2);
    print_spread("density", &s->density_1_m2, 1.0, "points/m2");
    print_spread("incidence", &s->incidence_rad, angle_deg(1.0), "deg");
    print_spread("range", &s->range_m, 1.0, "m");
    print_stations(r);
    if (r->label != NULL) print_labels(r);
}

/* ---- JSON */

static void put_area(struct json *json, const char *m2, const char *percent, double area_m2, double whole_m2)
{
    json_double(json, m2, area_m2);
    json_double(json, percent, coverage_percent(area_m2, whole_m2));
}

static void put_spread(struct json *json, const char *key, const struct coverage_spread *s, double unit)
{
    json_open_object(json, key);
    json_double(json, "mean", s->mean * unit);
    json_double(json, "p05", s->p05 * unit);
    json_double(json, "p50", s->p50 * unit);
    json_double(json, "p95", s->p95 * unit);
    json_close_object(json);
}

static void put_station(struct json *json, const struct coverage_result *r, uint32_t i)
{
    const struct coverage_result_station *s = &r->station[i];
    json_open_object(json, NULL);
    json_string(json, "name", r->site->station[i].station->name);
    page_put_vector(json, "position_m", r->site->station[i].at.position_m);
    json_uint(json, "pulses", s->pulses.cast);
    json_uint(json, "met", s->pulses.met);
    json_uint(json, "hits", s->pulses.hits);
    json_uint(json, "front_hits", s->pulses.front);
    put_area(json, "seen_m2", "seen_percent", s->seen_m2, r->sums.area_m2);
    put_area(json, "alone_m2", "alone_percent", s->alone_m2, r->sums.area_m2);
    json_close_object(json);
}

static void put_label(struct json *json, const struct coverage_result *r, uint32_t i)
{
    const struct coverage_of_label *l = &r->label[i];
    json_open_object(json, NULL);
    json_uint(json, "label", i);
    json_string(json, "object", r->site->scene->surface[i].object);
    json_string(json, "material", r->site->scene->surface[i].material);
    json_double(json, "area_m2", l->area_m2);
    put_area(json, "seen_m2", "seen_percent", l->seen_m2, l->area_m2);
    put_area(json, "several_m2", "several_percent", l->several_m2, l->area_m2);
    json_double(json, "density_1_m2", l->seen_m2 > 0.0 ? (double)l->pulses / l->seen_m2 : (double)NAN);
    json_close_object(json);
}

void coverage_put(struct json *json, const struct coverage_result *r)
{
    const struct coverage_sums *s = &r->sums;
    json_double(json, "cell_m", r->cell_m);
    json_uint(json, "cells", s->cells);
    json_uint(json, "pieces", s->pieces);
    json_uint(json, "triangles", s->triangles);
    json_double(json, "area_m2", s->area_m2);
    json_double(json, "duplicate_m2", s->duplicate_m2);
    json_double(json, "silent_m2", s->silent_m2);
    put_area(json, "none_m2", "none_percent", s->none_m2, s->area_m2);
    put_area(json, "one_m2", "one_percent", s->one_m2, s->area_m2);
    put_area(json, "several_m2", "several_percent", s->several_m2, s->area_m2);
    put_spread(json, "density_1_m2", &s->density_1_m2, 1.0);
    put_spread(json, "incidence_deg", &s->incidence_rad, angle_deg(1.0));
    put_spread(json, "range_m", &s->range_m, 1.0);
    json_open_array(json, "stations");
    for (uint32_t i = 0; i < r->site->n_stations; i++)
        put_station(json, r, i);
    json_close_array(json);
    if (r->label == NULL) return;
    json_open_array(json, "labels");
    for (uint32_t i = 0; i < r->site->scene->n_surfaces; i++)
        put_label(json, r, i);
    json_close_array(json);
}
