/* SPDX-License-Identifier: MIT */
/* Georeferencing at 200 places all over the Earth. Exact figures are compared with definitions in long double
 * (tests/common/geodesy.h), and the errors of orders 1 to 3 with their bounds. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "core/plan.h"
#include "tests/accuracy/stations.h"
#include "tests/common/cases.h"
#include "tests/common/geodesy.h"

static struct georef *make(int i, enum georef_crs crs)
{
    struct georef_spec spec = station_spec(i, crs);
    struct georef *georef;
    struct sh_err err;
    if (georef_create(&spec, &georef, &err) != SH_OK) fail_msg("place %d: %s", i, err.text);
    return georef;
}

static double true_error_m(int i, const struct georef *georef, const struct station_points *p,
                           double out[3][STATIONS_BATCH], int k)
{
    struct georef_spec s = station_spec(i, georef_crs(georef));
    const double d[3] = {p->in[0][k], p->in[1][k], p->in[2][k]}, got[3] = {out[0][k], out[1][k], out[2][k]};
    double anchor[3];
    long double p_ecef[3];
    georef_anchor(georef, anchor);
    geodesy_ecef(s.lat_deg, s.lon_deg, s.height_m, d, p_ecef);
    return geodesy_error_m(georef_epsg(georef), anchor, got, p_ecef);
}

static const enum georef_crs CRS[] = {GEOREF_ECEF, GEOREF_UTM, GEOREF_GEODETIC};

/* The bounds of GEOREF_EXACT itself are 20 nm, and 5 nm in ECEF. */
static void test_exact_against_definitions(void **state)
{
    (void)state;
    static struct station_points p;
    double worst_m[3] = {0.0, 0.0, 0.0};
    for (int i = 0; i < STATIONS; i++)
        for (int c = 0; c < 3; c++) {
            struct georef *georef = make(i, CRS[c]);
            station_scatter(&p, (uint64_t)i + 100, 5000.0, 3000.0);
            station_forward(georef, &p, p.exact);
            for (int k = i % 50; k < STATIONS_BATCH; k += 50) {
                double error_m = true_error_m(i, georef, &p, p.exact, k);
                if (!(error_m <= georef_bound_m(georef, GEOREF_EXACT, 5000.0, 3000.0)))
                    fail_msg("place %d, EPSG %d: off by %.3g m", i, georef_epsg(georef), error_m);
                worst_m[c] = fmax(worst_m[c], error_m);
            }
            georef_free(georef);
        }
    print_message("# exact: ecef %.2g m, utm and ups %.2g m, geodetic %.2g m\n", worst_m[0], worst_m[1], worst_m[2]);
}

/* Orders 1 to 3 are within their bounds, and these are tight: where errors are above rounding, a bound is at most ten
 * times the largest error found. Bounds of degrees within ten radii of a pole may be looser: no point there has all
 * largest terms. */
static void test_bounds(void **state)
{
    (void)state;
    static struct station_points p;
    static const double radius_m[] = {10.0, 100.0, 1000.0, 5000.0, 10000.0};
    double loosest = 0.0, tightest = (double)INFINITY;
    int tried = 0;
    for (int i = 0; i < STATIONS; i++)
        for (int c = 1; c < 3; c++) {
            struct georef *georef = make(i, CRS[c]);
            for (int r = 0; r < 5; r++) {
                double height_m = (i + r) % 3 == 0 ? 0.02 * radius_m[r] : fmin(radius_m[r], 3000.0);
                int near_pole = c == 2 && (90.0 - fabs(station_spec(i, CRS[c]).lat_deg)) * 111e3 < 10.0 * radius_m[r];
                station_scatter(&p, (uint64_t)(5 * i + r) + 3000, radius_m[r], height_m);
                georef_set_method(georef, GEOREF_EXACT, NULL);
                station_forward(georef, &p, p.exact);
                for (enum georef_method m = GEOREF_ORDER1; m <= GEOREF_ORDER3; m++) {
                    double bound_m = georef_bound_m(georef, m, radius_m[r], height_m);
                    if (!isfinite(bound_m)) continue;
                    assert_int_equal(georef_set_method(georef, m, NULL), SH_OK);
                    station_forward(georef, &p, p.out);
                    double error_m = station_error_m(georef, &p);
                    if (!(error_m <= bound_m))
                        fail_msg("place %d, EPSG %d, order %d within %g m: off by %.4g m, bound %.4g m", i,
                                 georef_epsg(georef), 1 + (int)m - (int)GEOREF_ORDER1, radius_m[r], error_m, bound_m);
                    tried++;
                    if (error_m < 1e-6 || near_pole) continue;
                    loosest = fmax(loosest, bound_m / error_m);
                    tightest = fmin(tightest, bound_m / error_m);
                }
            }
            georef_free(georef);
        }
    print_message("# bounds: %d tried; %.3g to %.3g times the largest error found, where that is above 1 um\n", tried,
                  tightest, loosest);
    assert_true(loosest < 10.0);
    assert_true(tried > 5900); /* of 6000; the others are geodetic near a pole */
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_exact_against_definitions),
        cmocka_unit_test(test_bounds),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
