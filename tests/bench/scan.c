/* SPDX-License-Identifier: MIT */
/* This describes a whole scan, and the sight that is to be made for it. */
#include <math.h>
#include <string.h>
#include <time.h>

#include "tests/bench/sight.h"

enum { BUNDLE = 8, MOST_OF_A_ROUND = 5000000 };

void bench_scan_of(double pulses, uint32_t every, struct bench_scan *out)
{
    const double fov_deg = BENCH_HIGHEST_DEG - BENCH_LOWEST_DEG;
    /* In steps of 4 pulses, BUNDLE lines have a multiple of the widest packet. */
    double of_line = 4.0 * round(sqrt(pulses * fov_deg / 360.0) / 4.0);
    out->line_pulses = (uint32_t)fmin(fmax(of_line, 4.0), BENCH_MAX_LINE);
    out->lines = BUNDLE * (uint32_t)fmax(round(pulses / out->line_pulses / BUNDLE), 1.0);
    out->pulses = (uint64_t)out->lines * out->line_pulses;
    out->bundle = BUNDLE;
    out->every = every != 0 ? every : (uint32_t)(out->pulses / MOST_OF_A_ROUND) + 1;
}

static const double RAD = M_PI / 180.0;

/* Returns false where no pulse of such a scan goes, as sight_spec asks. */
static int scan_sees(const void *ctx, const double dir[3], double radius_rad)
{
    (void)ctx;
    const double elevation_rad = asin(fmin(fmax(dir[2], -1.0), 1.0));
    return elevation_rad + radius_rad >= BENCH_LOWEST_DEG * RAD &&
           elevation_rad - radius_rad <= BENCH_HIGHEST_DEG * RAD;
}

static double share(void) /* the share of the sphere that the scan covers */
{
    return (sin(BENCH_HIGHEST_DEG * RAD) - sin(BENCH_LOWEST_DEG * RAD)) / 2.0;
}

void bench_scan_spec(const struct bench_scan *scan, const struct bvh *bvh, const double station_m[3],
                     struct sight_spec *out)
{
    *out = (struct sight_spec){.bvh = bvh,
                               .rays = (double)scan->pulses / share(),
                               .memory_bytes = (uint64_t)BENCH_SIGHT_MIB << 20,
                               .sees = scan_sees};
    memcpy(out->station_m, station_m, sizeof out->station_m);
}

int bench_scan_plan(const struct bench_scan *scan, const struct bvh *bvh, const double station_m[3], int *map,
                    struct sh_err *err)
{
    struct schedule_spec spec;
    struct bvh_info info;
    struct plan_row row;
    struct plan_place place = {.setup = {.bvh = bvh,
                                         .range_min_m = 0.5,
                                         .range_max_m = BENCH_RANGE_MAX_M,
                                         .mirror_counts = BENCH_ENCODER,
                                         .pan_counts = BENCH_ENCODER,
                                         .layout = LINE_POLAR,
                                         .range_scale_m = BENCH_SCALE_M},
                               .pulses = scan->pulses};
    bench_schedule(scan->lines, scan->line_pulses, 0, &spec);
    schedule_start(&place.segment, &spec);
    memcpy(place.setup.station_m, station_m, sizeof place.setup.station_m);
    pose_heading(0.0, place.setup.rotation);
    info = *bvh_get_info(bvh);
    const struct plan_sight_need need = {.pulses = (double)scan->pulses,
                                         .share = share(),
                                         .n_triangles = bvh_scene(bvh)->n_triangles,
                                         .packet = info.packet,
                                         .memory_bytes = (uint64_t)BENCH_SIGHT_MIB << 20,
                                         .forced = -1};
    return plan_sight(&need, &(struct plan_places){&place, 1}, NULL, map, &row, err);
}

double bench_process_s(void)
{
    struct timespec t;
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}
