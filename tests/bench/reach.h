/* SPDX-License-Identifier: MIT */
/* Heads and bodies that move, far stations and reaches (tests/common/reach_cases.h): what a pulse costs beside a head, or a
 * body, that stands. README.md says how it is measured. */
#ifndef TESTS_BENCH_REACH_H
#define TESTS_BENCH_REACH_H

#include "firmware_sim/base/json.h"
#include "tests/common/reach_cases.h"

enum { BENCH_REACH_ROUNDS = 41, BENCH_MAX_REACH = 16 };

struct bench_reach {
    const struct reach_case *of;
    double ns;                   /* a pulse of the whole cast, median */
    double by_standing, by_near; /* its time by theirs: medians of the rounds' ratios */
    double leaves, decided;      /* a packet; a ray */
    double load_s, mib;          /* processor time of loading; of all BVHs */
    uint32_t triangles;
};
/* house: the mesh around the head; NULL: a room. Pin the thread first. */
int bench_reach(const char *house, struct bench_reach out[BENCH_MAX_REACH], uint32_t *n, struct sh_err *err);

/* ---- print_reach.c */
void bench_put_reach(struct json *json, const struct bench_reach *reach, uint32_t n);
void bench_table_reach(FILE *out, const struct bench_reach *reach, uint32_t n);

#endif
