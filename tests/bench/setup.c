/* SPDX-License-Identifier: MIT */
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "core/rng.h"
#include "tests/bench/bench.h"

int bench_georef(const struct bench_target *target, struct georef **out, struct sh_err *err)
{
    struct georef_spec spec = {.crs = GEOREF_ECEF, .lat_deg = 52.5167, .lon_deg = 13.4001, .height_m = 111.6};
    memcpy(spec.station_m, target->station_m, sizeof spec.station_m);
    return georef_create(&spec, out, err);
}

int bench_embree(const struct scene *scene, const double origin_m[3], int robust, struct embree_alone *out,
                 struct sh_err *err)
{
    struct embree_alone_spec spec = {.robust = robust, .range_max_m = (float)BENCH_RANGE_MAX_M};
    memcpy(spec.origin_m, origin_m, sizeof spec.origin_m);
    return embree_alone_create(scene, &spec, out, err);
}

void bench_setup(const struct bench_case *c, const struct georef *georef, struct cast_setup *setup)
{
    *setup = (struct cast_setup){.bvh = c->bvh,
                                 .georef = georef,
                                 .range_min_m = 0.5,
                                 .range_max_m = BENCH_RANGE_MAX_M,
                                 .noise_on = 1,
                                 .range_sigma_m = 0.005,
                                 .noise_key = rng_key(1, RNG_RANGE),
                                 .mirror_counts = BENCH_ENCODER,
                                 .pan_counts = BENCH_ENCODER,
                                 .layout = LINE_GEO,
                                 .range_scale_m = BENCH_SCALE_M,
                                 .xyz_scale = {BENCH_SCALE_M, BENCH_SCALE_M, BENCH_SCALE_M}};
    memcpy(setup->station_m, c->target->station_m, sizeof setup->station_m);
    pose_heading(0.0, setup->rotation);
}

int bench_choose_embree(struct embree_alone *e, uint32_t *width, enum embree_feed *feed, double (*cost)(void *ctx),
                        void *ctx, struct sh_err *err)
{
    double least = INFINITY;
    uint32_t best_width = 16;
    enum embree_feed best_feed = EMBREE_PREPARED;
    for (int i = 0; i < 6; i++) {
        *width = 4U << i / 2;
        *feed = i % 2 == 0 ? EMBREE_PREPARED : EMBREE_LOADED;
        int rc = embree_alone_prepare(e, *width, *feed, err);
        if (rc != SH_OK) return rc;
        const double now = cost(ctx);
        if (now >= least) continue;
        least = now;
        best_width = *width;
        best_feed = *feed;
    }
    *width = best_width;
    *feed = best_feed;
    return embree_alone_prepare(e, best_width, best_feed, err);
}

double bench_thread_s(void)
{
    struct timespec t;
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

static int compare(const void *a, const void *b)
{
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

void bench_sort(double *values, size_t n)
{
    qsort(values, n, sizeof *values, compare);
}

double bench_median(double *values, uint32_t n)
{
    bench_sort(values, n);
    return n % 2 == 1 ? values[n / 2] : 0.5 * (values[n / 2 - 1] + values[n / 2]);
}
