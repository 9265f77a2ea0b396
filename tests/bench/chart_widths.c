/* SPDX-License-Identifier: MIT */
/* This measures what the polynomials of georeferencing cost on each vector width of this CPU. It prints rows of the
 * chart's table, but the chart does not draw them. The loops are those of the program
 * (core/georef/polynomial_kernels.h), compiled once more for each instruction set. Errors are against the exact method.
 * README.md says how to read it. */
#include <math.h>
#include <stdio.h>

#include "core/georef/polynomial_kernels.h"
#include "core/georef/state.h"
#include "core/rng.h"
#include "tests/bench/bench.h"
#include "tests/bench/pin.h"

enum { POINTS = 2048, ROUNDS = 25, TIMES = 100, MAPS = 4, MAX_WIDTHS = 4 };

#if defined(__x86_64__)
POLYNOMIAL_KERNELS(__attribute__((target("arch=x86-64"))), baseline)
POLYNOMIAL_KERNELS(__attribute__((target("arch=x86-64-v3"))), avx2)
POLYNOMIAL_KERNELS(__attribute__((target("arch=x86-64-v4"))), avx512)
#else
POLYNOMIAL_KERNELS(, baseline)
#endif

struct width {
    const char *name;
    const struct polynomial_kernels *kernels;
};

static int find_widths(struct width width[MAX_WIDTHS])
{
    int n = 0;
    width[n++] = (struct width){"SSE2: 2 doubles", &baseline};
#if defined(__x86_64__)
    __builtin_cpu_init();
    if (__builtin_cpu_supports("avx2")) width[n++] = (struct width){"AVX2: 4 doubles", &avx2};
    if (__builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512vl"))
        width[n++] = (struct width){"AVX-512: 8 doubles", &avx512};
#else
    width[0].name = "baseline";
#endif
    return n;
}

/* Each form of polynomial comes with the order that 2 km take. */
static const struct {
    const char *name;
    struct georef_spec spec;
    int order;
} MAP[MAPS] = {
    {"to UTM: order 3", {.crs = GEOREF_UTM, .lat_deg = 52.5, .lon_deg = 13.4}, 3},
    {"to geodetic: order 3", {.crs = GEOREF_GEODETIC, .lat_deg = 52.5, .lon_deg = 13.4}, 3},
    {"UTM to geodetic: order 5",
     {.crs = GEOREF_GEODETIC, .lat_deg = 52.5, .lon_deg = 13.4, .prcs_is_grid = 1, .prcs_zone = 33, .prcs_north = 1},
     5},
    {"UTM to ECEF: order 3",
     {.crs = GEOREF_ECEF, .lat_deg = 52.5, .lon_deg = 13.4, .prcs_is_grid = 1, .prcs_zone = 33, .prcs_north = 1},
     3}};

static double in[3][POINTS], out[3][POINTS], exact[3][POINTS], error_m[POINTS];

static void scatter(void)
{
    for (uint64_t i = 0; i < POINTS; i++)
        for (int k = 0; k < 3; k++)
            in[k][i] = (k < 2 ? 1400.0 : 700.0) *
                       ((double)(rng_u64(rng_key(9, RNG_SCENE), 3 * i + (uint64_t)k) >> 11) * 0x1p-52 - 1.0);
}

static void compare_points(const struct georef *georef)
{
    double degree_m = 6399594.0 * M_PI / 180.0, weight[3] = {1.0, 1.0, 1.0};
    if (georef_crs(georef) == GEOREF_GEODETIC) weight[0] = weight[1] = degree_m;
    for (int i = 0; i < POINTS; i++) {
        double sum = 0.0;
        for (int k = 0; k < 3; k++)
            sum += pow((out[k][i] - exact[k][i]) * weight[k], 2);
        error_m[i] = sqrt(sum);
    }
    bench_sort(error_m, POINTS);
}

static int measure(int map, const struct width *width, int n_widths)
{
    double ns[MAX_WIDTHS][ROUNDS];
    struct georef *georef;
    struct sh_err err;
    if (georef_create(&MAP[map].spec, &georef, &err) != SH_OK) {
        fprintf(stderr, "chart: %s\n", err.text);
        return 1;
    }
    georef_forward(georef, POINTS, (struct vec3_in){in[0], in[1], in[2]},
                   (struct vec3_out){exact[0], exact[1], exact[2]});
    for (int round = 0; round < ROUNDS; round++)
        for (int w = 0; w < n_widths; w++) {
            double start_s = bench_thread_s();
            for (int k = 0; k < TIMES; k++)
                polynomial_apply_with(width[w].kernels, &georef->polynomial, MAP[map].order, POINTS,
                                      (struct vec3_in){in[0], in[1], in[2]}, (struct vec3_out){out[0], out[1], out[2]});
            ns[w][round] = 1e9 * (bench_thread_s() - start_s) / TIMES / POINTS;
        }
    for (int w = 0; w < n_widths; w++) {
        polynomial_apply_with(width[w].kernels, &georef->polynomial, MAP[map].order, POINTS,
                              (struct vec3_in){in[0], in[1], in[2]}, (struct vec3_out){out[0], out[1], out[2]});
        compare_points(georef);
        double median = bench_median(ns[w], ROUNDS);
        printf("georef width,%s,%s,%.3f,%.3g,%.3g,0,0,,\n", MAP[map].name, width[w].name, median,
               error_m[(int)(0.999 * POINTS)], error_m[POINTS - 1]);
        fprintf(stderr, "chart: %-26s %-20s %6.2f ns per point, error at most %.2g m\n", MAP[map].name, width[w].name,
                median, error_m[POINTS - 1]);
    }
    georef_free(georef);
    return 0;
}

int main(void)
{
    struct width width[MAX_WIDTHS];
    int n = find_widths(width);
    pin(NULL);
    scatter();
    for (int i = 0; i < MAPS; i++)
        if (measure(i, width, n) != 0) return 1;
    return fflush(stdout) == 0 ? 0 : 1;
}
