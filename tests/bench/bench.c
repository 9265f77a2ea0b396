/* SPDX-License-Identifier: MIT */
/* This is build/bench. It measures how fast the head computes, beside Embree alone. README.md says what is measured and
 * how. */
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "tests/bench/bench.h"
#include "tests/bench/options.h"
#include "tests/bench/pin.h"
#include "tests/bench/print.h"

static void warn(void *ctx, const char *text)
{
    (void)ctx;
    fprintf(stderr, "bench: %s\n", text);
}

/* Only warnings are shown, because each scene here announces itself what takes long. */
static const struct sh_report REPORT = {.warn = warn};

static uint32_t all_threads(const struct bench_options *o)
{
    long n = o->threads != 0 ? o->threads : sysconf(_SC_NPROCESSORS_ONLN);
    return n < 1 ? 1 : n > 64 ? 64 : (uint32_t)n;
}

static int measure_stages(const struct bench_options *o, const struct bench_case *c, struct bench_scene_report *out,
                          struct sh_err *err)
{
    cpu_set_t before;
    out->stages = 1;
    pin(&before);
    int rc = bench_measure(c, &out->result, err);
    unpin(&before);
    uint32_t threads[2] = {1, all_threads(o)};
    for (uint32_t i = 0; i < (threads[1] > 1 ? 2U : 1U) && rc == SH_OK; i++) {
        rc = bench_loop(c, &out->result, threads[i], &out->loop[i], err);
        if (rc == SH_OK) out->n_loop++;
    }
    return rc;
}

/* By default whole scans leave out small scenes, which show nothing new, and the largest, whose 15 rounds take long. */
static const char *scans_of(const struct bench_options *o, const struct bench_target *target)
{
    const uint32_t triangles = target->scene->n_triangles;
    if (o->pulses != NULL) return strcmp(o->pulses, "none") == 0 ? "" : o->pulses;
    if (bench_is_house(target->name)) return "22.5M,1M";
    return triangles >= 90000 && triangles <= 2000000 ? "22.5M,2.8M" : "";
}

static int measure_sights(const struct bench_options *o, const struct bench_case *c, struct bench_scene_report *out,
                          struct sh_err *err)
{
    const char *list = scans_of(o, c->target);
    char pulses[32];
    cpu_set_t before;
    int rc = SH_OK;
    pin(&before);
    while (rc == SH_OK && (list = bench_next_name(list, pulses, sizeof pulses)) != NULL) {
        struct bench_scan scan;
        fprintf(stderr, "bench: %s, %s pulses\n", c->target->name, pulses);
        bench_scan_of(bench_pulses(pulses), o->whole ? 1 : 0, &scan);
        rc = bench_sight(c, &scan, &out->sight[out->n_sights], err);
        if (rc == SH_OK) out->n_sights++;
    }
    unpin(&before);
    return rc;
}

static int measure_target(const struct bench_options *o, const struct bench_target *target,
                          struct bench_scene_report *out, struct sh_err *err)
{
    struct embree_alone embree = {0}, fast = {0};
    struct bench_rays rays = {0};
    struct bench_case c = {.target = target, .rays = &rays, .embree = &embree, .fast = &fast, .seconds = o->seconds};
    int rc = bench_rays_create(BENCH_LINES, &rays, err);
    if (rc == SH_OK) rc = bench_embree(target->scene, target->station_m, 1, &embree, err);
    if (rc == SH_OK) rc = bench_embree(target->scene, target->station_m, 0, &fast, err);
    if (rc == SH_OK) rc = bvh_create(target->scene, 0, &REPORT, &c.bvh, err);
    if (rc == SH_OK) {
        snprintf(out->name, sizeof out->name, "%s", target->name);
        out->triangles = target->scene->n_triangles;
        out->load_s = target->load_s;
        out->embree_build_s = embree.build_s;
        out->info = *bvh_get_info(c.bvh);
        if (!o->only_sight) rc = measure_stages(o, &c, out, err);
        if (rc == SH_OK) rc = measure_sights(o, &c, out, err);
    }
    bvh_free(c.bvh);
    embree_alone_free(&embree);
    embree_alone_free(&fast);
    bench_rays_free(&rays);
    return rc;
}

static int measure_scene(const struct bench_options *o, const char *name, struct bench_report *report,
                         struct sh_err *err)
{
    struct bench_target target;
    const char *house = o->house != NULL ? o->house : BENCH_HOUSE_FILE;
    if (bench_is_house(name) && o->house == NULL && access(house, R_OK) != 0) {
        snprintf(report->note[report->n_notes++ % BENCH_MAX_NOTES], sizeof report->note[0],
                 "%s left out: %s: %s (Debian: assimp-testmodels; or --house FILE)", name, house, strerror(errno));
        return SH_OK;
    }
    fprintf(stderr, "bench: %s\n", name);
    int rc = bench_target_load(name, house, &REPORT, &target, err);
    if (rc == SH_OK) rc = measure_target(o, &target, &report->scene[report->n_scenes], err);
    if (rc == SH_OK) report->n_scenes++;
    bench_target_free(&target);
    return rc;
}

/* The reach is measured in the house if its file is there. */
static int measure_reach(const struct bench_options *o, struct bench_report *report, struct sh_err *err)
{
    const char *house = o->house != NULL ? o->house : BENCH_HOUSE_FILE;
    cpu_set_t before;
    pin(&before);
    int rc =
        bench_reach(o->house != NULL || access(house, R_OK) == 0 ? house : NULL, report->reach, &report->n_reach, err);
    unpin(&before);
    return rc;
}

static int measure(const struct bench_options *o, struct bench_report *report, struct sh_err *err)
{
    const char *list = o->scenes != NULL ? o->scenes : "";
    char name[32];
    int rc = SH_OK;
    while (rc == SH_OK && (list = bench_next_name(list, name, sizeof name)) != NULL)
        rc = measure_scene(o, name, report, err);
    if (rc == SH_OK && o->reach) rc = measure_reach(o, report, err);
    if (rc == SH_OK && o->leaks > 0.0) {
        rc = bench_leaks((uint64_t)o->leaks, 1, all_threads(o), &REPORT, report->leaks, err);
        report->have_leaks = rc == SH_OK;
    }
    return rc;
}

static int write_out(const struct bench_options *o, const struct bench_report *report, struct sh_err *err)
{
    if (o->out == NULL) return bench_print_json(stdout, report, err);
    FILE *out = fopen(o->out, "w");
    if (out == NULL) return sh_fail(err, SH_EIO, "%s: %s", o->out, strerror(errno));
    int rc = bench_print_json(out, report, err);
    if (fclose(out) != 0 && rc == SH_OK) rc = sh_fail(err, SH_EIO, "%s: %s", o->out, strerror(errno));
    if (rc == SH_OK) bench_print_table(stdout, report);
    return rc;
}

static int judge(const struct bench_report *report, struct sh_err *err)
{
    uint64_t leaks = 0; /* a ray that passes its target has slipped through, too */
    for (int i = 0; i < BENCH_LEAK_MESHES && report->have_leaks; i++)
        leaks += report->leaks[i].leaks + report->leaks[i].passed + report->leaks[i].sight_differ;
    return leaks == 0 ? SH_OK : sh_fail(err, SH_ESTATE, "bench: %llu rays leaked", (unsigned long long)leaks);
}

/* Wrong input is the user's fault. Every other error is a failure. */
static int fail(const struct sh_err *err)
{
    fprintf(stderr, "bench: %s\n", err->text);
    return err->code == SH_EINPUT ? BENCH_USAGE : BENCH_FAILED;
}

int main(int argc, char **argv)
{
    struct bench_options o;
    struct sh_err err = {0};
    int status = bench_parse(&o, argc, argv);
    if (status >= 0) return status;
    struct bench_report *report = calloc(1, sizeof *report);
    int rc = report != NULL ? measure(&o, report, &err) : sh_fail(&err, SH_ENOMEM, "no memory");
    if (rc == SH_OK) rc = write_out(&o, report, &err);
    if (rc == SH_OK) rc = judge(report, &err);
    free(report);
    return rc == SH_OK ? BENCH_OK : fail(&err);
}
