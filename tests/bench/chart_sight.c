/* SPDX-License-Identifier: MIT */
/* This measures how many pulses a scan needs until a sight pays, and prints rows of the chart's table.
 *
 * The figures are the cost of a pulse, with a sight's building shared by all pulses of the scan. Embree alone, robust,
 * stands for comparison. For each number of pulses the cheapest method and the cheapest exact one are on the front. */
#include <math.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

#include "tests/bench/options.h"
#include "tests/bench/pin.h"
#include "tests/bench/sight.h"

enum { CAST = 1000000 /* of a round */ };

static const char *const SCENES[][2] = {{"house", "house"}, {"100k", "terrain 200 m wide"}};
static const double PULSES[] = {1e5, 3e5, 1e6, 3e6, 1e7, 3e7, 1e8};

static void print_rows(const char *scene, double pulses, const struct bench_sight *s)
{
    const double sight_ns = s->sight_ns + s->build_ns, exact_ns = fmin(sight_ns, s->without_ns);
    const double ns[] = {s->embree_ns, s->without_ns, sight_ns};
    static const char *const name[] = {"float", "decided", "sight"};
    for (int i = 0; i < 3; i++)
        printf("pulses,%s %.0e,%s,%.3f,,,%d,%d,,\n", name[i], pulses, scene, ns[i],
               i == 0 ? ns[0] < exact_ns : ns[i] <= exact_ns, i != 0 && s->planned == (i == 2));
    fflush(stdout);
}

static int measure(struct bench_case *c, const char *name, struct sh_err *err)
{
    for (size_t i = 0; i < sizeof PULSES / sizeof PULSES[0]; i++) {
        struct bench_scan scan;
        struct bench_sight result;
        bench_scan_of(PULSES[i], (uint32_t)(PULSES[i] / CAST) + 1, &scan);
        fprintf(stderr, "chart: %s, %.0e pulses\n", name, PULSES[i]);
        int rc = bench_sight(c, &scan, &result, err);
        if (rc != SH_OK) return rc;
        print_rows(name, PULSES[i], &result);
    }
    return SH_OK;
}

static int draw_scene(const char *const scene[2], struct sh_err *err)
{
    struct bench_target target;
    struct embree_alone embree = {0};
    struct bench_case c = {.target = &target, .embree = &embree};
    int rc = bench_target_load(scene[0], BENCH_HOUSE_FILE, NULL, &target, err);
    if (rc == SH_OK) rc = bench_embree(target.scene, target.station_m, 1, &embree, err);
    if (rc == SH_OK) rc = bvh_create(target.scene, 0, NULL, &c.bvh, err);
    if (rc == SH_OK) rc = measure(&c, scene[1], err);
    bvh_free(c.bvh);
    embree_alone_free(&embree);
    bench_target_free(&target);
    return rc;
}

int main(void)
{
    struct sh_err err;
    pin(NULL);
    for (size_t i = 0; i < sizeof SCENES / sizeof SCENES[0]; i++) {
        if (strcmp(SCENES[i][0], "house") == 0 && access(BENCH_HOUSE_FILE, R_OK) != 0) continue;
        if (draw_scene(SCENES[i], &err) != SH_OK) {
            fprintf(stderr, "chart: %s\n", err.text);
            return 1;
        }
    }
    return fflush(stdout) == 0 ? 0 : 1;
}
