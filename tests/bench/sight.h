/* SPDX-License-Identifier: MIT */
/* What a sight saves in whole scans, its building included, beside Embree alone on the same rays. README.md
 * says how it is measured. ns: per pulse, one core. */
#ifndef TESTS_BENCH_SIGHT_H
#define TESTS_BENCH_SIGHT_H

#include "core/plan.h"
#include "tests/bench/bench.h"

enum { BENCH_SIGHT_ROUNDS = 15, BENCH_SIGHT_MIB = 64 /* cast.sight_mib */ };

/* A whole scan of so many pulses, the same angle between lines and in them; and what of it is cast: of each
 * `bundle * every` lines that follow each other the first `bundle`. */
struct bench_scan {
    uint64_t pulses; /* lines * line_pulses */
    uint32_t lines, line_pulses, bundle, every;
};
/* Every: 1: all lines; 0: as many as a round has time for. */
void bench_scan_of(double pulses, uint32_t every, struct bench_scan *out);
/* False where no pulse of such a scan goes: what sight_spec asks. */
int bench_scan_sees(const void *ctx, const double dir[3], double radius_rad);
/* What a sight is made of for it. */
void bench_scan_spec(const struct bench_scan *scan, const struct bvh *bvh, const double station_m[3],
                     struct sight_spec *out);
/* Whether the plan takes a map for it. */
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
    double one_ns, few_ns, ask_ns;           /* by what the map says; NaN: there is too little of it */
    double few, asked;                       /* shares of the pulses */
    double build_s, build_ns;                /* processor time; by all pulses of the scan */
    double cast_ratio, pipeline_ratio;       /* Embree's time by building and ours: medians of the rounds */
    double cast_ratio_without, pipeline_ratio_without;
    double gain;               /* of the cast: without by with, building included */
    int planned;               /* a map, for so many pulses */
    double plan_s, plan_ratio; /* what choosing took; the better of both by what the plan takes */
    uint64_t different;        /* pulses of a round that met something else than without */
    struct sight_info info;
};

/* Pin the thread first. */
int bench_sight(const struct bench_case *c, const struct bench_scan *scan, struct bench_sight *out, struct sh_err *err);

#endif
