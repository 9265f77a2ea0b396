/* SPDX-License-Identifier: MIT */
/* This measures the arithmetic around the cast: each kernel alone, on arrays that stay in the cache, in turns. Figures
 * are processor time of the thread, medians of the rounds, in ns per pulse.
 *
 *   build/tests/bench/kernels          the version that the program takes on this CPU
 *
 * Built with -DVEC_ONE there is but one version, for the instruction set of the compiler's options. */
#include <stdio.h>
#include <string.h>

#include "core/cast/kernels_aim.h"
#include "core/cast/kernels_points.h"
#include "core/cast/kernels_sweep.h"
#include "core/cast/kernels_times.h"
#include "core/mat3.h"
#include "core/rng.h"
#include "tests/bench/bench.h"
#include "tests/bench/pin.h"

enum { N = BVH_CHUNK, ROUNDS = 41, TIMES = 100 };

/* The arrays do not lie whole pages apart, because they would then push each other out of a cache. */
struct vectors {
    double x[N + 48], y[N + 48], z[N + 48];
};
static struct {
    double mirror[N + 48], pan[N + 48], range_m[N + 48];
    struct vectors d, e;
    uint64_t key[N + 48];
    uint32_t a[N + 48], b[N + 48], c[N + 48], label[N + 48], dt_ns[N + 48];
    uint16_t labels[N + 48];
    uint8_t number[N + 48], echo[N + 48];
} m;

/* 0.04 degrees a pulse, encoders of 2^20 counts */
static const struct schedule_run run = {.n = N,
                                        .in_line = 16,
                                        .r = 16,
                                        .num = 1,
                                        .mirror0_turn = -0.1,
                                        .mirror_turn_per_r = 0.04 / 360.0,
                                        .pan0_turn = 0.3,
                                        .pan_step_turn = 1e-6,
                                        .ns_quot = 3333,
                                        .ns_rem = 1,
                                        .ns_den = 3};
static const struct kernel_turns turns = {N, m.mirror, m.pan};
static const struct kernel_pulses sweep = {&run, 0, {N, m.mirror, m.pan}};
static const struct cast_setup setup = {
    .mirror_counts = BENCH_ENCODER, .pan_counts = BENCH_ENCODER, .range_scale_m = BENCH_SCALE_M};
static const double rotation[9] = {0.6, 0.8, 0, -0.8, 0.6, 0, 0, 0, 1};
static const double scale[3] = {BENCH_SCALE_M, BENCH_SCALE_M, BENCH_SCALE_M};
static const struct vec3_out d = {m.d.x, m.d.y, m.d.z}, e = {m.e.x, m.e.y, m.e.z};
static const struct vec3_in read_e = {m.e.x, m.e.y, m.e.z};
static const struct kernel_wire wire = {m.a, m.b, m.c};
static struct kernel_steps steps;

static void times(void)
{
    kernel_times(&run, m.dt_ns);
}
static void angles(void)
{
    kernel_angles(&run, 0, N, m.mirror, m.pan);
}
static void even(void)
{
    kernel_sweep(&steps, &sweep, rotation, &d, NULL);
}
static void even_read(void)
{
    kernel_sweep(&steps, &sweep, rotation, &d, &(struct kernel_reading){&setup, mat3_unit, e});
}
static void one_by_one(void)
{
    kernel_directions(&turns, rotation, &d, NULL);
}
static void one_by_one_read(void)
{
    kernel_directions(&turns, rotation, &d, &(struct kernel_reading){&setup, mat3_unit, e});
}
static void limits(void)
{
    kernel_limit(m.range_m, 0.5, 1e4, N);
}
static void keys(void)
{
    kernel_keys(1000, m.number, N, m.key);
}
static void noise(void)
{
    detect_fixed_noise(0.005, 0.0, 123, N, m.key, m.range_m);
}
static void entries(void)
{
    kernel_entries(m.range_m, m.label, N, m.echo, m.labels);
}
static void polar(void)
{
    kernel_polar(&setup, m.range_m, &turns, &wire);
}
static void place(void)
{
    kernel_place(&read_e, m.range_m, scale, N, &wire);
}

static const struct {
    const char *name;
    void (*pass)(void);
} kernel[] = {{"times", times},
              {"angles", angles},
              {"directions, even steps", even},
              {"  and what encoders read", even_read},
              {"directions, one by one", one_by_one},
              {"  and what encoders read", one_by_one_read},
              {"limits", limits},
              {"keys of random numbers", keys},
              {"range noise", noise},
              {"entries", entries},
              {"polar: counts", polar},
              {"geo: position and counts", place}};
enum { KERNELS = sizeof kernel / sizeof *kernel };

int main(void)
{
    static double ns[KERNELS][ROUNDS];
    pin(NULL);
    for (int i = 0; i < N; i++)
        m.range_m[i] = 10.0 + 0.01 * i;
    if (!kernel_sweep_steps(&steps, &run)) return 1;
    for (int round = 0; round < ROUNDS; round++)
        for (size_t k = 0; k < KERNELS; k++) {
            const double start_s = bench_thread_s();
            for (int i = 0; i < TIMES; i++)
                kernel[k].pass();
            ns[k][round] = 1e9 * (bench_thread_s() - start_s) / TIMES / N;
        }
    for (size_t k = 0; k < KERNELS; k++)
        printf("%-28s %6.2f ns per pulse\n", kernel[k].name, bench_median(ns[k], ROUNDS));
    return fflush(stdout) == 0 ? 0 : 1;
}
