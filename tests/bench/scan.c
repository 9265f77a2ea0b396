/* A whole scan, and what a sight is made of for it. */
#include <math.h>
#include <string.h>
#include <time.h>

#include "tests/bench/sight.h"

enum { BUNDLE = 8, MOST_OF_A_ROUND = 5000000 };

void bench_scan_of(double pulses, uint32_t every, struct bench_scan *out)
{
    const double fov_deg = BENCH_HIGHEST_DEG - BENCH_LOWEST_DEG;
    /* Of BUNDLE lines it is a multiple of the widest packet then. */
    double of_line = 4.0 * round(sqrt(pulses * fov_deg / 360.0) / 4.0);
    out->line_pulses = (uint32_t)fmin(fmax(of_line, 4.0), BENCH_MAX_LINE);
    out->lines = BUNDLE * (uint32_t)fmax(round(pulses / out->line_pulses / BUNDLE), 1.0);
    out->pulses = (uint64_t)out->lines * out->line_pulses;
    out->bundle = BUNDLE;
    out->every = every != 0 ? every : (uint32_t)(out->pulses / MOST_OF_A_ROUND) + 1;
}

static const double RAD = M_PI / 180.0;

int bench_scan_sees(const void *ctx, const double dir[3], double radius_rad)
{
    (void)ctx;
    const double elevation_rad = asin(fmin(fmax(dir[2], -1.0), 1.0));
    return elevation_rad + radius_rad >= BENCH_LOWEST_DEG * RAD &&
           elevation_rad - radius_rad <= BENCH_HIGHEST_DEG * RAD;
}

void bench_scan_spec(const struct bench_scan *scan, const struct bvh *bvh, const double station_m[3], int exact,
                     struct sight_spec *out)
{
    const double seen = (sin(BENCH_HIGHEST_DEG * RAD) - sin(BENCH_LOWEST_DEG * RAD)) / 2.0; /* of the sphere */
    *out = (struct sight_spec){.bvh = bvh,
                               .rays = (double)scan->pulses / seen,
                               .memory_bytes = (uint64_t)BENCH_SIGHT_MIB << 20,
                               .exact = exact,
                               .sees = bench_scan_sees};
    memcpy(out->station_m, station_m, sizeof out->station_m);
}

int bench_scan_chosen(const struct bench_scan *scan, uint32_t triangles)
{
    (void)scan;
    (void)triangles;
    return 1;
}

double bench_process_s(void)
{
    struct timespec t;
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}
