/* SPDX-License-Identifier: MIT */
/* This prints the results of bench_sight, as JSON and as tables, and beside each figure its bound. */
#include <math.h>
#include <string.h>

#include "tests/bench/print.h"

struct bound {
    const char *scene; /* NULL: any */
    double pulses;     /* 0: any */
    const char *name;
    double (*value)(const struct bench_sight *s);
    double bound;
    int at_most;
};

static double cast_ratio(const struct bench_sight *s)
{
    return s->cast_ratio;
}
static double pipeline_ratio(const struct bench_sight *s)
{
    return s->pipeline_ratio;
}
static double build_s(const struct bench_sight *s)
{
    return s->build_s;
}
static double peak_mib(const struct bench_sight *s)
{
    return (double)s->info.peak_bytes / 1048576.0;
}
static double plan_ratio(const struct bench_sight *s)
{
    return s->plan_ratio;
}
static double different(const struct bench_sight *s)
{
    return (double)s->different;
}

static const struct bound BOUND[] = {
    {"house", 22.5e6, "cast_ratio", cast_ratio, 4.0, 0},
    {"house", 22.5e6, "pipeline_ratio", pipeline_ratio, 1.6, 0},
    {"house", 1e6, "cast_ratio", cast_ratio, 1.0, 0},
    {"house", 0.0, "build_s", build_s, 0.1, 1},
    {"house", 0.0, "peak_mib", peak_mib, 16.0, 1},
    {"garden", 22.5e6, "cast_ratio", cast_ratio, 4.0, 0},
    {"garden", 22.5e6, "pipeline_ratio", pipeline_ratio, 1.1, 0},
    {"garden", 1e6, "cast_ratio", cast_ratio, 1.0, 0},
    {"garden", 0.0, "build_s", build_s, 0.1, 1},
    {"garden", 0.0, "peak_mib", peak_mib, 16.0, 1},
    {"100k", 22.5e6, "cast_ratio", cast_ratio, 2.0, 0},
    {NULL, 0.0, "plan_ratio", plan_ratio, 0.98, 0},
    {NULL, 0.0, "different", different, 0.0, 1},
};
enum { N_BOUNDS = sizeof BOUND / sizeof BOUND[0] };

/* Scans are of whole lines, so their pulses are within 1 % of the number that was asked for. */
static int applies(const struct bound *b, const char *scene, const struct bench_sight *s)
{
    return (b->scene == NULL || strcmp(b->scene, scene) == 0) &&
           (b->pulses == 0.0 || fabs((double)s->scan.pulses / b->pulses - 1.0) < 0.01);
}

static int reached(const struct bound *b, const struct bench_sight *s)
{
    return b->at_most ? b->value(s) <= b->bound : b->value(s) >= b->bound;
}

static const char *planned(const struct bench_sight *s)
{
    return s->planned ? "sight" : "without";
}

static void put_bounds(struct json *json, const char *scene, const struct bench_sight *s)
{
    json_open_array(json, "bounds");
    for (int i = 0; i < N_BOUNDS; i++) {
        const struct bound *b = &BOUND[i];
        if (!applies(b, scene, s)) continue;
        json_open_object(json, NULL);
        json_string(json, "name", b->name);
        json_double(json, "value", b->value(s));
        json_double(json, b->at_most ? "at_most" : "at_least", b->bound);
        json_bool(json, "reached", reached(b, s));
        json_close_object(json);
    }
    json_close_array(json);
}

static void put_map(struct json *json, const struct bench_sight *s)
{
    const struct sight_info *info = &s->info;
    json_uint(json, "cells", info->cells);
    json_open_object(json, "directions"); /* shares of those that are looked at */
    json_double(json, "one", info->one);
    json_double(json, "nothing", info->nothing);
    json_double(json, "few", info->few);
    json_double(json, "ask", info->ask);
    json_close_object(json);
    json_open_object(json, "of_pulses");
    json_double(json, "few", s->few);
    json_double(json, "asked", s->asked);
    json_close_object(json);
    json_uint(json, "lists", info->lists);
    json_uint(json, "records", info->records);
    json_double(json, "build_s", s->build_s);
    json_double(json, "mib", (double)info->bytes / 1048576.0);
    json_double(json, "peak_mib", peak_mib(s));
}

static void put_sight(struct json *json, const char *scene, const struct bench_sight *s)
{
    json_open_object(json, NULL);
    json_uint(json, "pulses", s->scan.pulses);
    json_uint(json, "lines", s->scan.lines);
    json_uint(json, "pulses_cast", s->cast);
    json_uint(json, "rounds", s->rounds);
    json_double(json, "cast_ratio", s->cast_ratio);
    json_double(json, "cast_ratio_without", s->cast_ratio_without);
    json_double(json, "pipeline_ratio", s->pipeline_ratio);
    json_double(json, "pipeline_ratio_without", s->pipeline_ratio_without);
    json_string(json, "plan", planned(s));
    json_double(json, "plan_ratio", s->plan_ratio);
    json_double(json, "plan_s", s->plan_s);
    json_double(json, "gain", s->gain);
    json_open_object(json, "ns_per_pulse");
    json_double(json, "embree", s->embree_ns);
    json_double(json, "without", s->without_ns);
    json_double(json, "build", s->build_ns);
    json_double(json, "cast", s->sight_ns);
    json_double(json, "one", s->one_ns);
    json_double(json, "few", s->few_ns);
    json_double(json, "ask", s->ask_ns);
    json_double(json, "pipeline_without", s->pipeline_without_ns);
    json_double(json, "pipeline", s->pipeline_ns);
    json_close_object(json);
    put_map(json, s);
    json_uint(json, "embree_packet", s->embree_width);
    json_string(json, "embree_feed", s->embree_feed == EMBREE_PREPARED ? "prepared" : "loaded");
    json_uint(json, "different", s->different);
    put_bounds(json, scene, s);
    json_close_object(json);
}

void bench_put_sights(struct json *json, const struct bench_scene_report *scene)
{
    json_open_array(json, "sight");
    for (uint32_t i = 0; i < scene->n_sights; i++)
        put_sight(json, scene->name, &scene->sight[i]);
    json_close_array(json);
}

static void table_ratios(FILE *out, const struct bench_report *report)
{
    fprintf(out,
            "\nwhole scans with a sight, its building included; one thread, Embree alone = 1; pipeline: noise off\n"
            "%-8s %9s | %6s %8s | %8s %8s | %6s %8s %6s\n",
            "scene", "pulses", "cast", "without", "pipeline", "without", "gain", "plan", "ratio");
    for (uint32_t i = 0; i < report->n_scenes; i++)
        for (uint32_t k = 0; k < report->scene[i].n_sights; k++) {
            const struct bench_sight *s = &report->scene[i].sight[k];
            fprintf(out, "%-8s %8.1fM | %6.2f %8.2f | %8.2f %8.2f | %6.2f %8s %6.3f\n", report->scene[i].name,
                    1e-6 * (double)s->scan.pulses, s->cast_ratio, s->cast_ratio_without, s->pipeline_ratio,
                    s->pipeline_ratio_without, s->gain, planned(s), s->plan_ratio);
        }
}

static void table_ns(FILE *out, const struct bench_report *report)
{
    fprintf(out,
            "\nns per pulse: the cast and its parts | everything; the map\n"
            "%-8s %9s | %7s %8s %7s %7s | %6s %6s %6s | %8s %8s | %8s %6s %6s %6s %6s\n",
            "scene", "pulses", "Embree", "without", "build", "cast", "one", "few", "ask", "pipeline", "without",
            "build ms", "MiB", "peak", "few %", "ask %");
    for (uint32_t i = 0; i < report->n_scenes; i++)
        for (uint32_t k = 0; k < report->scene[i].n_sights; k++) {
            const struct bench_sight *s = &report->scene[i].sight[k];
            fprintf(out,
                    "%-8s %8.1fM | %7.2f %8.2f %7.2f %7.2f | %6.1f %6.1f %6.0f | %8.2f %8.2f | %8.1f %6.2f %6.2f "
                    "%6.2f %6.3f\n",
                    report->scene[i].name, 1e-6 * (double)s->scan.pulses, s->embree_ns, s->without_ns, s->build_ns,
                    s->sight_ns, s->one_ns, s->few_ns, s->ask_ns, s->pipeline_ns, s->pipeline_without_ns,
                    1e3 * s->build_s, (double)s->info.bytes / 1048576.0, peak_mib(s), 100.0 * s->few, 100.0 * s->asked);
        }
}

static void table_bounds(FILE *out, const struct bench_report *report)
{
    fprintf(out, "\n%-8s %9s  %-15s %9s  %-10s %s\n", "scene", "pulses", "figure", "measured", "bound", "reached");
    for (uint32_t i = 0; i < report->n_scenes; i++)
        for (uint32_t k = 0; k < report->scene[i].n_sights; k++)
            for (int b = 0; b < N_BOUNDS; b++) {
                const struct bench_sight *s = &report->scene[i].sight[k];
                if (!applies(&BOUND[b], report->scene[i].name, s)) continue;
                fprintf(out, "%-8s %8.1fM  %-15s %9.3f  %s %-7.4g %s\n", report->scene[i].name,
                        1e-6 * (double)s->scan.pulses, BOUND[b].name, BOUND[b].value(s),
                        BOUND[b].at_most ? "<=" : ">=", BOUND[b].bound, reached(&BOUND[b], s) ? "yes" : "no");
            }
}

void bench_table_sights(FILE *out, const struct bench_report *report)
{
    uint32_t n = 0;
    for (uint32_t i = 0; i < report->n_scenes; i++)
        n += report->scene[i].n_sights;
    if (n == 0) return;
    table_ratios(out, report);
    table_ns(out, report);
    table_bounds(out, report);
}
