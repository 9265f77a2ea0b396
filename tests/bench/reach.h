/* SPDX-License-Identifier: MIT */
/* This measures heads and bodies that move, far stations and reaches (tests/common/reach_cases.h). It gives the cost of
 * a pulse beside that of a head, or a body, that stands. README.md says how it is measured. */
#ifndef TESTS_BENCH_REACH_H
#define TESTS_BENCH_REACH_H

#include "firmware_sim/base/json.h"
#include "tests/common/reach_cases.h"

enum { BENCH_REACH_ROUNDS = 41, BENCH_MAX_REACH = 16 };

struct bench_reach {
    const struct reach_case *of;
    double ns;                   /* a pulse of the whole cast, median */
    double by_standing, by_near; /* its time by that of the case that stands or is near: medians of the ratios */
    double leaves, decided;      /* per packet; per ray */
    double load_s, mib;          /* processor time of loading; of all BVHs */
    uint32_t triangles;
};
/* house names the mesh around the head. NULL takes a room. The caller must pin the thread first. */
int bench_reach(const char *house, struct bench_reach out[BENCH_MAX_REACH], uint32_t *n, struct sh_err *err);

/* ---- print_reach.c */
void bench_put_reach(struct json *json, const struct bench_reach *reach, uint32_t n);
void bench_table_reach(FILE *out, const struct bench_reach *reach, uint32_t n);

#endif
