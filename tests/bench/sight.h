/* SPDX-License-Identifier: MIT */
/* This measures what a sight saves in whole scans, its building included, beside Embree alone on the same rays.
 * README.md says how it is measured. ns is per pulse on one core. */
#ifndef TESTS_BENCH_SIGHT_H
#define TESTS_BENCH_SIGHT_H

#include "core/plan.h"
#include "tests/bench/bench.h"

enum { BENCH_SIGHT_ROUNDS = 15, BENCH_SIGHT_MIB = 64 /* cast.sight_mib */ };

/* A whole scan has so many pulses, with the same angle between lines and in them. Only the first `bundle` of each
 * `bundle * every` lines in a row are cast. */
struct bench_scan {
    uint64_t pulses; /* lines * line_pulses */
    uint32_t lines, line_pulses, bundle, every;
};
/* every 1 casts all lines. 0 casts as many as a round has time for. */
void bench_scan_of(double pulses, uint32_t every, struct bench_scan *out);
/* Sets what a sight is made of for the scan. */
void bench_scan_spec(const struct bench_scan *scan, const struct bvh *bvh, const double station_m[3],
                     struct sight_spec *out);
/* Sets *map if the plan takes a map for the scan. */
int bench_scan_plan(const struct bench_scan *scan, const struct bvh *bvh, const double station_m[3], int *map,
                    struct sh_err *err);
double bench_process_s(void); /* processor time of all threads */

struct bench_sight {
    struct bench_scan scan;
    uint64_t cast; /* pulses of a round */
    uint32_t rounds, embree_width;
    enum embree_feed embree_feed;
    double embree_ns, without_ns, sight_ns;  /* the cast: Embree, the BVH, the sight without its building */
    double pipeline_without_ns, pipeline_ns; /* everything, noise off; the latter without building, too */
    double one_ns, few_ns, ask_ns;           /* by the map's three answers; NaN: there is too little of it */
    double few, asked;                       /* shares of the pulses */
    double build_s, build_ns;                /* processor time; by all pulses of the scan */
    double cast_ratio, pipeline_ratio;       /* Embree's time by building and ours: medians of the rounds */
    double cast_ratio_without, pipeline_ratio_without;
    double gain;               /* of the cast: its time without by that with, building included */
    int planned;               /* the plan takes a map for so many pulses */
    double plan_s, plan_ratio; /* time of the choice; the faster way's time by that of the plan's choice */
    uint64_t different;        /* pulses of a round that hit another triangle or range than without */
    struct sight_info info;
};

/* The caller must pin the thread first. */
int bench_sight(const struct bench_case *c, const struct bench_scan *scan, struct bench_sight *out, struct sh_err *err);

#endif
