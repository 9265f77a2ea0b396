/* SPDX-License-Identifier: MIT */
#include "tests/bench/print.h"

#include <inttypes.h>
#include <string.h>
#include <unistd.h>

#include "firmware_sim/base/json.h"

static void cpu_name(char *buf, size_t len)
{
    char line[256];
    snprintf(buf, len, "unknown");
    FILE *in = fopen("/proc/cpuinfo", "r");
    if (in == NULL) return;
    while (fgets(line, sizeof line, in) != NULL) {
        char *colon = strchr(line, ':');
        if (strncmp(line, "model name", 10) != 0 || colon == NULL) continue;
        line[strcspn(line, "\n")] = '\0';
        snprintf(buf, len, "%s", colon + 1 + strspn(colon + 1, " "));
        break;
    }
    fclose(in);
}

static const char *isa(void)
{
#if defined(__x86_64__)
    return __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512vl") ? "avx512"
           : __builtin_cpu_supports("avx2")                                        ? "avx2"
           : __builtin_cpu_supports("avx")                                         ? "avx"
           : __builtin_cpu_supports("sse4.2")                                      ? "sse4.2"
                                                                                   : "sse2";
#elif defined(__aarch64__)
    return "neon";
#else
    return "other";
#endif
}

static void embree_name(char buf[32])
{
    long v = RTC_VERSION;
    snprintf(buf, 32, "%ld.%ld.%ld", v / 10000, v / 100 % 100, v % 100);
}

static void put_machine(struct json *json)
{
    char cpu[128], embree[32];
    cpu_name(cpu, sizeof cpu);
    embree_name(embree);
    json_open_object(json, "machine");
    json_string(json, "cpu", cpu);
    json_string(json, "isa", isa());
    json_int(json, "processors", sysconf(_SC_NPROCESSORS_ONLN));
    json_string(json, "embree", embree);
    json_close_object(json);
}

static double rest_ns(const struct bench_result *r)
{
    double rest = r->pipeline_ns;
    for (int s = 0; s < BENCH_STAGES; s++)
        rest -= r->stage_ns[s];
    return rest;
}

/* Prints the counts of n rays as counts per million. */
static void put_counters(struct json *json, const struct cast_counters *c, double rays)
{
    double per_million = rays > 0.0 ? 1e6 / rays : 0.0;
    json_open_object(json, "per_million");
    json_double(json, "decided", (double)c->decided * per_million);
    json_close_object(json);
}

static void put_loop(struct json *json, const struct bench_scene_report *s)
{
    json_open_array(json, "threads");
    for (uint32_t i = 0; i < s->n_loop; i++) {
        const struct bench_threads *t = &s->loop[i];
        json_open_object(json, NULL);
        json_uint(json, "threads", t->threads);
        json_double(json, "embree_mrays_s", t->embree_mrays_s);
        json_double(json, "pulses_per_s", t->pulses_per_s);
        json_double(json, "pipeline_ratio", t->ratio);
        json_double(json, "cpu_ns_per_pulse", t->cpu_ns);
        json_close_object(json);
    }
    json_close_array(json);
    if (s->n_loop == 0) return;
    json_double(json, "pipeline_ratio_all_threads", s->loop[s->n_loop - 1].ratio);
    json_double(json, "pulses_per_s_all_threads", s->loop[s->n_loop - 1].pulses_per_s);
}

static void put_result(struct json *json, const struct bench_scene_report *s)
{
    const struct bench_result *r = &s->result;
    json_double(json, "embree_mrays_s", 1e3 / r->embree_ns);
    json_double(json, "cast_ratio", r->cast_ratio);
    json_double(json, "pipeline_ratio", r->pipeline_ratio);
    json_double(json, "cast_ratio_not_robust", r->fast_ratio);
    json_double(json, "pipeline_ratio_ideal_encoders", r->ideal_ratio);
    json_double(json, "cast_mrays_s", 1e3 / r->cast_ns);
    json_double(json, "pipeline_mpulses_s", 1e3 / r->pipeline_ns);
    json_open_object(json, "ns_per_pulse"); /* they add up to the whole pipeline */
    for (int i = 0; i < BENCH_STAGES; i++)
        json_double(json, bench_stage_name[i], r->stage_ns[i]);
    json_double(json, "rest", rest_ns(r));
    json_close_object(json);
    json_double(json, "embree_ns", r->embree_ns);
    json_double(json, "embree_not_robust_ns", r->fast_ns);
    json_double(json, "cast_ns", r->cast_ns);
    json_double(json, "pipeline_ns", r->pipeline_ns);
    json_bool(json, "stages_give_same_bytes", r->same_bytes);
    put_loop(json, s);
    put_counters(json, &r->counters, r->pulses);
    json_uint(json, "packet", s->info.packet);
    json_uint(json, "embree_packet", r->embree_width);
    json_string(json, "embree_feed", r->embree_feed == EMBREE_PREPARED ? "prepared" : "loaded");
    json_uint(json, "rounds", r->rounds);
    json_uint(json, "pulses", r->pulses);
}

static void put_scene(struct json *json, const struct bench_scene_report *s)
{
    json_open_object(json, NULL);
    json_string(json, "scene", s->name);
    json_uint(json, "triangles", s->triangles);
    if (s->stages) put_result(json, s);
    json_double(json, "load_s", s->load_s);
    json_double(json, "build_s", s->info.build_s);
    json_double(json, "embree_build_s", s->embree_build_s);
    json_double(json, "bytes_per_triangle", (double)s->info.bytes / s->triangles);
    bench_put_sights(json, s);
    json_close_object(json);
}

static void put_leaks(struct json *json, const struct bench_leaks *l)
{
    json_open_object(json, NULL);
    json_string(json, "mesh", l->mesh);
    json_uint(json, "triangles", l->triangles);
    json_uint(json, "rays", l->rays);
    json_uint(json, "leaks", l->leaks);
    json_uint(json, "passed_silhouette", l->passed);
    json_double(json, "ns_per_ray", l->ns_per_ray);
    json_uint(json, "plain_rays", l->plain_rays);
    json_uint(json, "plain_leaks", l->plain_leaks);
    json_uint(json, "sight_rays", l->sight_rays);
    json_uint(json, "sight_differ", l->sight_differ);
    json_uint(json, "sight_asked", l->sight_asked);
    put_counters(json, &l->counters, (double)l->rays);
    json_close_object(json);
}

int bench_print_json(FILE *out, const struct bench_report *report, struct sh_err *err)
{
    struct json json;
    json_begin(&json, out);
    json_open_object(&json, NULL);
    put_machine(&json);
    json_open_array(&json, "scenes");
    for (uint32_t i = 0; i < report->n_scenes; i++)
        put_scene(&json, &report->scene[i]);
    json_close_array(&json);
    if (report->have_leaks) {
        json_open_array(&json, "leaks");
        for (int i = 0; i < BENCH_LEAK_MESHES; i++)
            put_leaks(&json, &report->leaks[i]);
        json_close_array(&json);
    }
    if (report->n_reach != 0) bench_put_reach(&json, report->reach, report->n_reach);
    json_open_array(&json, "notes");
    for (uint32_t i = 0; i < report->n_notes; i++)
        json_string(&json, NULL, report->note[i]);
    json_close_array(&json);
    json_close_object(&json);
    return json_end(&json, err);
}

static void table_speed(FILE *out, const struct bench_report *report)
{
    fprintf(out, "%-8s %11s %9s %6s %9s | %9s %7s %7s | %9s %9s\n", "scene", "triangles", "Embree", "cast", "pipeline",
            "all thr.", "M/s", "ratio", "build s", "bytes/tri");
    for (uint32_t i = 0; i < report->n_scenes; i++) {
        const struct bench_scene_report *s = &report->scene[i];
        const struct bench_threads *t = &s->loop[s->n_loop != 0 ? s->n_loop - 1 : 0];
        fprintf(out, "%-8s %11u %7.1f/s %6.3f %9.3f | %9u %7.1f %7.3f | %9.2f %9.0f\n", s->name, s->triangles,
                1e3 / s->result.embree_ns, s->result.cast_ratio, s->result.pipeline_ratio, t->threads,
                1e-6 * t->pulses_per_s, t->ratio, s->info.build_s, (double)s->info.bytes / s->triangles);
    }
}

static void table_stages(FILE *out, const struct bench_report *report)
{
    fprintf(out, "\nns per pulse, one thread (Embree alone | the stages of the pipeline | their sum)\n%-8s %7s |",
            "scene", "Embree");
    for (int i = 0; i < BENCH_STAGES; i++)
        fprintf(out, " %*s", (int)strlen(bench_stage_name[i]) > 6 ? (int)strlen(bench_stage_name[i]) : 6,
                bench_stage_name[i]);
    fprintf(out, " %6s | %7s\n", "rest", "all");
    for (uint32_t k = 0; k < report->n_scenes; k++) {
        const struct bench_result *r = &report->scene[k].result;
        fprintf(out, "%-8s %7.2f |", report->scene[k].name, r->embree_ns);
        for (int i = 0; i < BENCH_STAGES; i++)
            fprintf(out, " %*.2f", (int)strlen(bench_stage_name[i]) > 6 ? (int)strlen(bench_stage_name[i]) : 6,
                    r->stage_ns[i]);
        fprintf(out, " %6.2f | %7.2f\n", rest_ns(r), r->pipeline_ns);
    }
}

static void table_leaks(FILE *out, const struct bench_report *report)
{
    fprintf(out, "\nrays at edges and corners of closed meshes\n%-14s %10s %12s %7s %9s %8s | %s\n", "mesh",
            "triangles", "rays", "leaks", "decided", "ns/ray", "Embree alone, robust");
    for (int i = 0; i < BENCH_LEAK_MESHES; i++) {
        const struct bench_leaks *l = &report->leaks[i];
        fprintf(out, "%-14s %10u %12" PRIu64 " %7" PRIu64 " %8.1f%% %8.0f | %" PRIu64 " of %" PRIu64 "\n", l->mesh,
                l->triangles, l->rays, l->leaks, 100.0 * (double)l->counters.decided / (double)l->rays, l->ns_per_ray,
                l->plain_leaks, l->plain_rays);
    }
}

void bench_print_table(FILE *out, const struct bench_report *report)
{
    char cpu[128], embree[32];
    cpu_name(cpu, sizeof cpu);
    embree_name(embree);
    fprintf(out, "%s, %s, Embree %s\n\n", cpu, isa(), embree);
    if (report->n_scenes != 0 && report->scene[0].stages) {
        fprintf(out, "Embree: million rays/s alone; cast, pipeline: speed of exact hits and of everything, "
                     "Embree alone = 1\n");
        table_speed(out, report);
        table_stages(out, report);
    }
    bench_table_sights(out, report);
    bench_table_reach(out, report->reach, report->n_reach);
    if (report->have_leaks) table_leaks(out, report);
    for (uint32_t i = 0; i < report->n_notes; i++)
        fprintf(out, "\n%s\n", report->note[i]);
}
