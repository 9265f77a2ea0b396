/* SPDX-License-Identifier: MIT */
/* This measures speed against accuracy of the ways to georeference, and prints rows of the chart's table. README.md
 * says how to read it. Points go from the scene frame to UTM and UPS. Errors are against tests/common/geodesy.h, which
 * shares nothing with GeographicLib. */
#include <math.h>
#include <stdio.h>

#include "core/plan.h"
#include "core/rng.h"
#include "tests/bench/bench.h"
#include "tests/common/geodesy.h"
#include "tests/bench/pin.h"

enum { PLACES = 6, POINTS = 2048, METHODS = 5, ROUNDS = 15, SCENES = 5 };

/* The places are an ordinary one, a zone's edge on the equator, the neighbouring zone forced there, 83.9 N, UPS, and a
 * high one. */
static const struct georef_spec PLACE[PLACES] = {
    {.lat_deg = 52.5, .lon_deg = 13.4, .height_m = 110.0},   {.lat_deg = 1.0, .lon_deg = 11.99, .height_m = 20.0},
    {.lat_deg = 1.0, .lon_deg = 13.2, .utm_zone = 32},       {.lat_deg = 83.9, .lon_deg = -40.0, .height_m = 500.0},
    {.lat_deg = -89.0, .lon_deg = 77.0, .height_m = 2800.0}, {.lat_deg = 28.0, .lon_deg = 86.9, .height_m = 9000.0}};

static const struct {
    const char *name;
    double radius_m, height_m;
} SCENE[SCENES] = {{"10 m", 10.0, 5.0},
                   {"100 m", 100.0, 40.0},
                   {"1 km", 1000.0, 400.0},
                   {"2 km", 2000.0, 700.0},
                   {"5 km", 5000.0, 1000.0}};

/* The flat method turns metres by the grid's convergence and stretches them by its scale at the station. The program
 * does not have it. */
#define FLAT GEOREF_AUTO
static const char *const NAME[METHODS] = {"flat earth", "order 1", "order 2", "order 3", "exact"};
static const enum georef_method METHOD[METHODS] = {FLAT, GEOREF_ORDER1, GEOREF_ORDER2, GEOREF_ORDER3, GEOREF_EXACT};

struct result {
    double ns[ROUNDS], ns_median, err_p999_m, err_max_m;
    int front, is_default;
};

static double in[3][POINTS], out[3][POINTS];
static long double truth[POINTS][3]; /* geocentric */
static double error_m[METHODS][PLACES * POINTS];

static double unit(uint64_t i)
{
    return (double)(rng_u64(rng_key(7, RNG_SCENE), i) >> 11) * 0x1p-53;
}

static void scatter(int scene)
{
    for (uint64_t i = 0; i < POINTS; i++) {
        double r = SCENE[scene].radius_m * sqrt(unit(3 * i)), angle = 2.0 * M_PI * unit(3 * i + 1);
        in[0][i] = r * cos(angle);
        in[1][i] = r * sin(angle);
        in[2][i] = SCENE[scene].height_m * (2.0 * unit(3 * i + 2) - 1.0);
    }
}

static void go_flat(const struct georef *georef)
{
    double angle, scale;
    georef_convergence(georef, &angle, &scale);
    const double c = scale * cos(angle), s = scale * sin(angle);
    for (int i = 0; i < POINTS; i++) {
        out[0][i] = c * in[0][i] - s * in[1][i];
        out[1][i] = s * in[0][i] + c * in[1][i];
        out[2][i] = in[2][i];
    }
}

static void go(struct georef *georef, int m)
{
    if (METHOD[m] == FLAT)
        go_flat(georef);
    else
        georef_forward(georef, POINTS, (struct vec3_in){in[0], in[1], in[2]},
                       (struct vec3_out){out[0], out[1], out[2]});
}

static void measure_errors(struct georef *georef, int place)
{
    double anchor[3];
    georef_anchor(georef, anchor);
    for (int i = 0; i < POINTS; i++) {
        const double d[3] = {in[0][i], in[1][i], in[2][i]};
        geodesy_ecef(PLACE[place].lat_deg, PLACE[place].lon_deg, PLACE[place].height_m, d, truth[i]);
        long double p[3];
        geodesy_position(georef_epsg(georef), truth[i], p);
        for (int k = 0; k < 3; k++)
            truth[i][k] = p[k] - (long double)anchor[k];
    }
    for (int m = 0; m < METHODS; m++) {
        if (METHOD[m] != FLAT) georef_set_method(georef, METHOD[m], NULL);
        go(georef, m);
        for (int i = 0; i < POINTS; i++) {
            long double sum = 0;
            for (int k = 0; k < 3; k++)
                sum += ((long double)out[k][i] - truth[i][k]) * ((long double)out[k][i] - truth[i][k]);
            error_m[m][place * POINTS + i] = (double)sqrtl(sum);
        }
    }
}

static void measure_speed(struct georef *georef, struct result *result)
{
    for (int round = 0; round < ROUNDS; round++)
        for (int m = 0; m < METHODS; m++) {
            int times = METHOD[m] == GEOREF_EXACT ? 2 : 500;
            if (METHOD[m] != FLAT) georef_set_method(georef, METHOD[m], NULL);
            double start_s = bench_thread_s();
            for (int k = 0; k < times; k++)
                go(georef, m);
            result[m].ns[round] = 1e9 * (bench_thread_s() - start_s) / times / POINTS;
        }
}

/* Returns the method that the plan takes at the place that needs most. */
static int planned(const struct georef *georef, int scene, int before)
{
    const struct plan_georef_need need = {
        .radius_m = SCENE[scene].radius_m, .height_m = SCENE[scene].height_m, .tolerance_m = 1e-6};
    struct plan_row row;
    enum georef_method method;
    if (plan_georef(georef, &need, &method, &row, NULL) != SH_OK) return before;
    for (int m = 0; m < METHODS; m++)
        if (METHOD[m] == method && m > before) return m;
    return before;
}

static void finish(struct result *result, int the_default)
{
    for (int m = 0; m < METHODS; m++) {
        bench_sort(error_m[m], PLACES * POINTS);
        result[m].ns_median = bench_median(result[m].ns, ROUNDS);
        result[m].err_p999_m = error_m[m][(int)(0.999 * PLACES * POINTS)];
        result[m].err_max_m = error_m[m][PLACES * POINTS - 1];
        result[m].is_default = m == the_default;
    }
    for (int m = 0; m < METHODS; m++) {
        const struct result *a = &result[m];
        result[m].front = 1;
        for (int k = 0; k < METHODS; k++) {
            const struct result *b = &result[k];
            int no_worse =
                b->ns_median <= a->ns_median && b->err_p999_m <= a->err_p999_m && b->err_max_m <= a->err_max_m;
            int better = b->ns_median < a->ns_median || b->err_p999_m < a->err_p999_m || b->err_max_m < a->err_max_m;
            if (no_worse && better) result[m].front = 0;
        }
    }
}

static int draw_scene(int scene)
{
    struct result result[METHODS] = {0};
    int the_default = 0;
    scatter(scene);
    for (int i = 0; i < PLACES; i++) {
        struct georef_spec spec = PLACE[i];
        struct georef *georef;
        struct sh_err err;
        spec.crs = GEOREF_UTM;
        if (georef_create(&spec, &georef, &err) != SH_OK) {
            fprintf(stderr, "chart: %s\n", err.text);
            return 1;
        }
        measure_errors(georef, i);
        the_default = planned(georef, scene, the_default);
        if (i == 0) measure_speed(georef, result);
        georef_free(georef);
    }
    finish(result, the_default);
    for (int m = 0; m < METHODS; m++)
        printf("georef,%s,%s,%.3f,%.3g,%.3g,%d,%d,,\n", NAME[m], SCENE[scene].name, result[m].ns_median,
               result[m].err_p999_m, result[m].err_max_m, result[m].front, result[m].is_default);
    return 0;
}

int main(void)
{
    pin(NULL);
    fprintf(stderr, "chart: georef\n");
    for (int i = 0; i < SCENES; i++)
        if (draw_scene(i) != 0) return 1;
    return fflush(stdout) == 0 ? 0 : 1;
}
