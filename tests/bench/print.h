/* SPDX-License-Identifier: MIT */
/* This prints the results of build/bench, as JSON and as a table. */
#ifndef TESTS_BENCH_PRINT_H
#define TESTS_BENCH_PRINT_H

#include <stdio.h>

#include "firmware_sim/base/json.h"
#include "tests/bench/bench.h"
#include "tests/bench/reach.h"
#include "tests/bench/sight.h"

enum { BENCH_MAX_SCENES = 16, BENCH_MAX_NOTES = 8, BENCH_MAX_SCANS = 4 };

struct bench_scene_report {
    char name[32];
    uint32_t triangles;
    double load_s, embree_build_s;
    struct bvh_info info;
    struct bench_result result;
    struct bench_threads loop[2]; /* one thread, all threads */
    uint32_t n_loop;
    int stages; /* result was measured; otherwise only the sights are there */
    struct bench_sight sight[BENCH_MAX_SCANS];
    uint32_t n_sights;
};

struct bench_report {
    struct bench_scene_report scene[BENCH_MAX_SCENES];
    uint32_t n_scenes;
    struct bench_leaks leaks[BENCH_LEAK_MESHES];
    int have_leaks;
    struct bench_reach reach[BENCH_MAX_REACH];
    uint32_t n_reach;
    char note[BENCH_MAX_NOTES][192];
    uint32_t n_notes;
};

int bench_print_json(FILE *out, const struct bench_report *report, struct sh_err *err);
void bench_print_table(FILE *out, const struct bench_report *report);

/* ---- print_sight.c */
void bench_put_sights(struct json *json, const struct bench_scene_report *scene);
void bench_table_sights(FILE *out, const struct bench_report *report);

#endif
