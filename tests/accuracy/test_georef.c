/* Georeferencing at 200 places all over the Earth: exact figures against definitions in long double (tests/geodesy.h),
 * the default method's and every order's error against their bounds. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <cmocka.h>

#include "core/plan.h"
#include "core/rng.h"
#include "tests/geodesy.h"

enum { PLACES = 200, BATCH = 1250 };

static double unit(uint64_t stream, uint64_t i)
{
    return (double)(rng_u64(rng_key(stream, RNG_SCENE), i) >> 11) * 0x1p-53;
}

/* Of eight: four in a zone of their own, one each forced into the neighbouring zone from up to 1.4 degrees beyond
 * the border, as far as that zone reaches on the equator, in UPS, at 83.9 N, at the antimeridian. Heights from the Dead
 * Sea to a drone over the Himalaya. */
static struct georef_spec place(int i, enum georef_crs crs)
{
    double u = unit(1, 3 * (uint64_t)i), v = unit(1, 3 * (uint64_t)i + 1), w = unit(1, 3 * (uint64_t)i + 2);
    int zone = i % 60;
    struct georef_spec s = {.crs = crs,
                            .station_m = {1e3 * u, -500.0 * v, 30.0 * w},
                            .lat_deg = -79.9 + 163.8 * u,
                            .lon_deg = -180.0 + 6.0 * zone + 6.0 * v,
                            .height_m = -400.0 + 9400.0 * w};
    switch (i % 8) {
    case 4:
        s.lat_deg = -75.0 + 150.0 * u;
        s.lon_deg = -180.0 + 6.0 * zone + 1.4 * v;
        s.utm_zone = zone == 0 ? 60 : zone;
        break;
    case 5:
        s.lat_deg = v < 0.5 ? 84.0 + 5.9 * u : -80.01 - 9.9 * u;
        break;
    case 6:
        s.lat_deg = 83.9;
        break;
    case 7:
        s.lon_deg = v < 0.5 ? 180.0 - 0.02 * v : -180.0 + 0.02 * (v - 0.5);
        break;
    default:
        break;
    }
    if (crs != GEOREF_UTM) s.utm_zone = 0;
    return s;
}

static struct georef *make(int i, enum georef_crs crs)
{
    struct georef_spec spec = place(i, crs);
    struct georef *georef;
    struct sh_err err;
    if (georef_create(&spec, &georef, &err) != SH_OK) fail_msg("place %d: %s", i, err.text);
    return georef;
}

struct points {
    double in[3][BATCH], out[3][BATCH], exact[3][BATCH];
};

/* Within the cylinder, evenly; every eighth on its rim, where errors are largest. */
static void scatter(struct points *p, uint64_t stream, double radius_m, double height_m)
{
    for (uint64_t i = 0; i < BATCH; i++) {
        double r = radius_m * (i % 8 == 0 ? 1.0 : sqrt(unit(stream, 3 * i)));
        double angle = 2.0 * M_PI * unit(stream, 3 * i + 1), up = 2.0 * unit(stream, 3 * i + 2) - 1.0;
        if (i % 16 == 0) up = up < 0.0 ? -1.0 : 1.0;
        p->in[0][i] = r * cos(angle);
        p->in[1][i] = r * sin(angle);
        p->in[2][i] = height_m * up;
    }
}

static void forward(const struct georef *georef, struct points *p, double out[3][BATCH])
{
    georef_forward(georef, BATCH, p->in[0], p->in[1], p->in[2], out[0], out[1], out[2]);
}

static double true_error_m(int i, const struct georef *georef, const struct points *p, double out[3][BATCH], int k)
{
    struct georef_spec s = place(i, georef_crs(georef));
    const double d[3] = {p->in[0][k], p->in[1][k], p->in[2][k]}, got[3] = {out[0][k], out[1][k], out[2][k]};
    double anchor[3];
    long double p_ecef[3];
    georef_anchor(georef, anchor);
    geodesy_ecef(s.lat_deg, s.lon_deg, s.height_m, d, p_ecef);
    return geodesy_error_m(georef_epsg(georef), anchor, got, p_ecef);
}

/* Against the exact method, on the ground. */
static double largest_error_m(int i, const struct georef *georef, struct points *p)
{
    struct georef_spec s = place(i, georef_crs(georef));
    double weight[3] = {1.0, 1.0, 1.0}, worst_m = 0.0;
    for (int k = 0; k < BATCH; k++) {
        if (s.crs == GEOREF_GEODETIC) {
            const double d[3] = {p->in[0][k], p->in[1][k], p->in[2][k]};
            long double e[3];
            geodesy_ecef(s.lat_deg, s.lon_deg, s.height_m, d, e);
            weight[0] = (6399593.626 + s.height_m + d[2]) * M_PI / 180.0;
            weight[1] = (double)hypotl(e[0], e[1]) * M_PI / 180.0;
        }
        double sum = 0.0;
        for (int c = 0; c < 3; c++)
            sum += pow((p->out[c][k] - p->exact[c][k]) * weight[c], 2);
        worst_m = sum == sum ? fmax(worst_m, sum) : (double)INFINITY;
    }
    return sqrt(worst_m);
}

static const enum georef_crs CRS[] = {GEOREF_ECEF, GEOREF_UTM, GEOREF_GEODETIC};

/* The bounds of GEOREF_EXACT themselves: 20 nm, ECEF 5 nm. */
static void test_exact_against_definitions(void **state)
{
    (void)state;
    static struct points p;
    double worst_m[3] = {0.0, 0.0, 0.0};
    for (int i = 0; i < PLACES; i++)
        for (int c = 0; c < 3; c++) {
            struct georef *georef = make(i, CRS[c]);
            scatter(&p, (uint64_t)i + 100, 5000.0, 3000.0);
            forward(georef, &p, p.exact);
            for (int k = i % 50; k < BATCH; k += 50) {
                double error_m = true_error_m(i, georef, &p, p.exact, k);
                if (!(error_m <= georef_bound_m(georef, GEOREF_EXACT, 5000.0, 3000.0)))
                    fail_msg("place %d, EPSG %d: off by %.3g m", i, georef_epsg(georef), error_m);
                worst_m[c] = fmax(worst_m[c], error_m);
            }
            georef_free(georef);
        }
    print_message("# exact: ecef %.2g m, utm and ups %.2g m, geodetic %.2g m\n", worst_m[0], worst_m[1], worst_m[2]);
}

/* What a run does within 2 km: 10^6 points, 5 nm for ECEF and 1 um for the others; one in 250 against the definitions,
 * too. */
static void test_default_method(void **state)
{
    (void)state;
    static struct points p;
    const struct plan_georef_need need = {.radius_m = 2000.0, .height_m = 2000.0, .tolerance_m = 1e-6};
    double worst_m = 0.0;
    int used[GEOREF_ORDER3 + 1] = {0}, points = 0;
    for (int i = 0; i < PLACES * 4; i++) {
        int round = (i + i / PLACES) % 4;
        struct georef *georef = make(i % PLACES, round == 3 ? GEOREF_UTM : CRS[round]);
        struct plan_row row;
        struct sh_err err;
        enum georef_method method;
        assert_int_equal(plan_georef(georef, &need, &method, &row, &err), SH_OK);
        used[method]++;
        scatter(&p, (uint64_t)i + 1000, need.radius_m, need.height_m);
        forward(georef, &p, p.exact);
        assert_int_equal(georef_set_method(georef, method, &err), SH_OK);
        forward(georef, &p, p.out);
        double error_m = largest_error_m(i % PLACES, georef, &p);
        for (int k = 0; k < BATCH; k += 250)
            error_m = fmax(error_m, true_error_m(i % PLACES, georef, &p, p.out, k));
        if (!(error_m <= row.error_m && row.error_m <= need.tolerance_m))
            fail_msg("place %d, EPSG %d, %s: off by %.3g m; bound %.3g m", i % PLACES, georef_epsg(georef), row.method,
                     error_m, row.error_m);
        worst_m = fmax(worst_m, error_m);
        points += BATCH;
        georef_free(georef);
    }
    assert_int_equal(points, 1000000);
    print_message("# default within 2 km: %.2g m at most; exact or rotation %d times, order 1 %d, 2 %d, 3 %d\n",
                  worst_m, used[GEOREF_EXACT], used[GEOREF_ORDER1], used[GEOREF_ORDER2], used[GEOREF_ORDER3]);
    assert_true(used[GEOREF_ORDER3] > PLACES); /* else it is not the polynomials that were tested */
}

/* Each order is within its bound, and the bound is not idle: where errors are above rounding it is at most ten times
 * the largest error found. */
static void test_bounds(void **state)
{
    (void)state;
    static struct points p;
    static const double radius_m[] = {10.0, 100.0, 1000.0, 5000.0, 10000.0};
    double loosest = 0.0, tightest = (double)INFINITY;
    int tried = 0;
    for (int i = 0; i < PLACES; i++)
        for (int c = 1; c < 3; c++) {
            struct georef *georef = make(i, CRS[c]);
            for (int r = 0; r < 5; r++) {
                double height_m = (i + r) % 3 == 0 ? 0.02 * radius_m[r] : fmin(radius_m[r], 3000.0);
                scatter(&p, (uint64_t)(5 * i + r) + 3000, radius_m[r], height_m);
                georef_set_method(georef, GEOREF_EXACT, NULL);
                forward(georef, &p, p.exact);
                for (enum georef_method m = GEOREF_ORDER1; m <= GEOREF_ORDER3; m++) {
                    double bound_m = georef_bound_m(georef, m, radius_m[r], height_m);
                    if (!isfinite(bound_m)) continue;
                    assert_int_equal(georef_set_method(georef, m, NULL), SH_OK);
                    forward(georef, &p, p.out);
                    double error_m = largest_error_m(i, georef, &p);
                    if (!(error_m <= bound_m))
                        fail_msg("place %d, EPSG %d, %s within %g m: off by %.4g m, bound %.4g m", i,
                                 georef_epsg(georef), plan_method_name(m), radius_m[r], error_m, bound_m);
                    tried++;
                    if (error_m < 1e-6) continue;
                    loosest = fmax(loosest, bound_m / error_m);
                    tightest = fmin(tightest, bound_m / error_m);
                }
            }
            georef_free(georef);
        }
    print_message("# bounds: %d tried; %.3g to %.3g times the largest error found, where that is above 1 um\n", tried,
                  tightest, loosest);
    assert_true(loosest < 10.0);
    assert_true(tried > 4500); /* of 6000; the others are geodetic near a pole, or beyond what was fitted */
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_exact_against_definitions),
        cmocka_unit_test(test_default_method),
        cmocka_unit_test(test_bounds),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
