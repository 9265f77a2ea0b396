/* SPDX-License-Identifier: MIT */
/* The method that a run takes within 2 km, in every CRS and from every kind of scene frame. Each of 200 places has
 * 1,250 points, 5,000 in level frames with THOROUGH=1, compared with GeographicLib point by point. The test also
 * compares the cost. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "core/geoframe.h"
#include "core/locate.h"
#include "core/plan.h"
#include "tests/accuracy/stations.h"
#include "tests/common/cases.h"
#include "tests/common/geodesy.h"
#include "tests/common/thorough.h"

enum { BATCHES = 4 }; /* at most */
enum scene_frame { LEVEL, TURNED, EARTH, GRID, NEXT_GRID };
static const char *const FRAME_NAME[] = {"tangent here", "tangent 30 km away, turned", "ECEF", "its UTM or UPS grid",
                                         "the next zone's grid"};

static const struct plan_georef_need NEED = {.radius_m = 2000.0, .height_m = 2000.0, .tolerance_m = 1e-6};

/* Within this distance of a pole geodetic coordinates are computed exactly, as no series follows points half around it.
 * In a turned frame points may be as far up as they are away, so they come nearer to the Earth's axis. */
static const double POLE_M[] = {13000.0, 20000.0, 20000.0, 13000.0, 13000.0};

struct tally {
    double worst_m, bound_m;
    int used[GEOREF_ORDER5 + 1], points;
};

static void say(const char *frame, const char *crs, const struct tally *t)
{
    print_message("# %-28s %-9s %8d points  %8.2g m  bound %8.2g m  linear or exact %d, order 1 %d, 2 %d, 3 %d, 5 %d\n",
                  frame, crs, t->points, t->worst_m, t->bound_m, t->used[GEOREF_EXACT], t->used[GEOREF_ORDER1],
                  t->used[GEOREF_ORDER2], t->used[GEOREF_ORDER3], t->used[GEOREF_ORDER5]);
}

static struct georef *create(const struct georef_spec *spec)
{
    struct georef *georef;
    struct sh_err err;
    if (georef_create(spec, &georef, &err) != SH_OK) fail_msg("%.6f %.6f: %s", spec->lat_deg, spec->lon_deg, err.text);
    return georef;
}

/* Sets the place in a scene whose frame is of that kind. */
static void set_frame(int i, enum scene_frame kind, struct georef_spec *spec)
{
    struct geoframe frame;
    struct georef_place at = {spec->lat_deg, spec->lon_deg, spec->height_m}, away = at;
    const double origin_m[3] = {512000.0, -3000.0, 7.0};
    double p_prcs[3];
    struct locate_grid grid;
    struct sh_err err;
    int zone, rc = SH_OK;
    if (kind == LEVEL) return;
    away.lat_deg += away.lat_deg > 0.0 ? -0.25 : 0.25;
    rc = locate_in_grid(&at, 0, &grid, &err);
    zone = grid.zone;
    if (kind == NEXT_GRID && spec->crs == GEOREF_UTM) spec->utm_zone = zone; /* 0 would be the scene's own */
    if (kind == NEXT_GRID) { /* the zone reaches up to 1.4 degrees beyond its border, on the equator */
        at.lon_deg = spec->lon_deg = 6.0 * zone - 186.0 + 0.007 * i;
        zone = (zone + 58) % 60 + 1;
    }
    if (rc == SH_OK && kind == TURNED) rc = geoframe_set_tangent(&frame, origin_m, &away, 7.3 * i, &err);
    if (rc == SH_OK && (kind == GRID || kind == NEXT_GRID)) rc = geoframe_set_grid(&frame, zone, grid.north, &err);
    if (kind == EARTH) geoframe_set_ecef(&frame);
    if (rc == SH_OK) rc = geoframe_find(&frame, &at, p_prcs, &err);
    if (rc == SH_OK) rc = geoframe_fill(&frame, p_prcs, spec, &err);
    if (rc != SH_OK) fail_msg("place %d: %s", i, err.text);
}

/* Asks GeographicLib for each point. If ours is linear, the reference goes by way of geodetic coordinates. */
static void reference(const struct georef_spec *spec, const struct georef *georef, struct station_points *p)
{
    double rotation[9], anchor[3], base[3];
    struct locate_grid grid;
    if (!georef_rotation(georef, rotation)) {
        station_forward(georef, p, p->exact);
        return;
    }
    struct georef_spec other = *spec;
    other.crs = GEOREF_GEODETIC;
    struct georef *geodetic = create(&other);
    station_forward(geodetic, p, p->exact);
    georef_anchor(geodetic, base);
    georef_anchor(georef, anchor);
    for (int k = 0; k < STATIONS_BATCH; k++) {
        struct georef_place at = {base[0] + p->exact[0][k], base[1] + p->exact[1][k], base[2] + p->exact[2][k]};
        double q[3], to_pole = 90.0 - fabs(at.lat_deg);
        at.lon_deg = remainder(at.lon_deg, 360.0); /* differences may lead across the antimeridian */
        int zone = georef_epsg(georef) % 100;
        if (zone == 61) zone = to_pole < 12.0 ? 0 : 61;
        if (spec->crs == GEOREF_ECEF)
            georef_geodetic_to_ecef(&at, q);
        else if (locate_in_grid(&at, zone, &grid, NULL) == SH_OK)
            memcpy(q, (const double[3]){grid.easting_m, grid.northing_m, at.height_m}, sizeof q);
        else
            fail_msg("no reference");
        for (int c = 0; c < 3; c++)
            p->exact[c][k] = q[c] - anchor[c];
    }
    georef_free(geodetic);
}

static void check_exact_only_at_pole(int i, enum scene_frame kind, const struct georef_spec *spec)
{
    double from_pole_m = (90.0 - fabs(spec->lat_deg)) * 111700.0;
    if (spec->crs != GEOREF_GEODETIC || from_pole_m > POLE_M[kind])
        fail_msg("place %d, scene in %s, CRS %d: exact, %.0f m from the pole", i, FRAME_NAME[kind], (int)spec->crs,
                 from_pole_m);
}

/* One point in 250 is compared with definitions, without GeographicLib, where the scene frame allows it: from ECEF
 * forward; from UTM to degrees and by the projection back. */
static double true_error_m(enum scene_frame kind, const struct georef_spec *spec, const struct georef *georef,
                           const struct station_points *p)
{
    double anchor[3], worst_m = 0.0;
    georef_anchor(georef, anchor);
    for (int k = 0; k < STATIONS_BATCH; k += 250) {
        const double got[3] = {p->out[0][k], p->out[1][k], p->out[2][k]};
        long double at[3], x, y;
        for (int c = 0; c < 3; c++)
            at[c] = (long double)spec->station_m[c] + (long double)p->in[c][k];
        if (kind == EARTH) {
            worst_m = fmax(worst_m, geodesy_error_m(georef_epsg(georef), anchor, got, at));
        } else if (kind >= GRID && spec->crs == GEOREF_GEODETIC && spec->prcs_zone != 0) {
            const long double deg = GEODESY_PI / 180;
            const struct geodesy place = {((long double)anchor[0] + (long double)got[0]) * deg,
                                          ((long double)anchor[1] + (long double)got[1]) * deg, 0};
            geodesy_utm(place, spec->prcs_zone, &x, &y);
            x += 5e5L - at[0];
            y += (spec->prcs_north ? 0 : 1e7L) - at[1];
            worst_m = fmax(worst_m, (double)hypotl(x, y));
        }
    }
    return worst_m;
}

static void try_place(int i, enum scene_frame kind, const struct georef_spec *spec, int batches, struct tally *t)
{
    static struct station_points p;
    struct georef *georef = create(spec);
    struct plan_row row;
    struct sh_err err;
    double rotation[9];
    enum georef_method method;
    assert_int_equal(plan_georef(georef, &NEED, &method, &row, &err), SH_OK);
    t->used[method]++;
    if (method == GEOREF_EXACT && !georef_rotation(georef, rotation)) check_exact_only_at_pole(i, kind, spec);
    for (int b = 0; b < batches; b++) {
        station_scatter(&p, (uint64_t)(i * BATCHES + b) + 1000, NEED.radius_m, NEED.height_m);
        assert_int_equal(georef_set_method(georef, GEOREF_EXACT, &err), SH_OK);
        reference(spec, georef, &p);
        assert_int_equal(georef_set_method(georef, method, &err), SH_OK);
        station_forward(georef, &p, p.out);
        double error_m = fmax(station_error_m(georef, &p), true_error_m(kind, spec, georef, &p));
        if (!(error_m <= fmax(row.error_m, 2e-8) && row.error_m <= NEED.tolerance_m)) /* 20 nm: the reference's own */
            fail_msg("place %d, scene in %s, EPSG %d, %s: off by %.3g m; bound %.3g m", i, FRAME_NAME[kind],
                     georef_epsg(georef), row.method, error_m, row.error_m);
        t->worst_m = fmax(t->worst_m, error_m);
        t->points += STATIONS_BATCH;
    }
    t->bound_m = fmax(t->bound_m, row.error_m);
    georef_free(georef);
}

/* UPS has a tally of its own. */
static void try_frame(enum scene_frame kind, int batches)
{
    static const enum georef_crs crs[] = {GEOREF_ECEF, GEOREF_UTM, GEOREF_GEODETIC};
    static const char *const name[] = {"ecef", "utm", "geodetic", "ups"};
    struct tally tally[4];
    memset(tally, 0, sizeof tally);
    const int step = kind == LEVEL ? 1 : thorough(1, 2); /* frames by turns */
    for (int i = (int)kind % step; i < STATIONS; i += step)
        for (int c = 0; c < 3; c++) {
            struct georef_spec spec = station_spec(i, crs[c]);
            int polar = spec.lat_deg >= 84.0 || spec.lat_deg < -80.0;
            if (kind == NEXT_GRID && polar) continue;
            set_frame(i, kind, &spec);
            try_place(i, kind, &spec, batches, &tally[c == 1 && polar ? 3 : c]);
        }
    for (int c = 0; c < 4; c++)
        if (tally[c].points > 0) say(FRAME_NAME[kind], name[c], &tally[c]);
    assert_int_equal(tally[1].points + tally[3].points, tally[0].points);
}

static void test_a_million_points(void **state)
{
    (void)state;
    print_message("# default method within 2 km, scene in: CRS, largest error and bound, how often which method\n");
    try_frame(LEVEL, thorough(BATCHES, 1));
}

static void test_other_scene_frames(void **state)
{
    (void)state;
    for (enum scene_frame kind = TURNED; kind <= NEXT_GRID; kind++)
        try_frame(kind, 1);
}

static double thread_s(void)
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

/* The promise is 10 ns a point, and exact costs 250 ns (geodetic) and 900 ns. The figures are medians of runs in
 * turns, which a busy machine slows alike. So any method near the promise has a ratio of 20. `make chart` has the
 * nanoseconds. */
static void test_cost(void **state)
{
    (void)state;
    enum { ROUNDS = 9, TIMES = 40 };
    static struct station_points p;
    static const enum georef_crs crs[] = {GEOREF_UTM, GEOREF_GEODETIC};
    for (int c = 0; c < 2; c++) {
        struct georef_spec spec = {.crs = crs[c], .lat_deg = 52.5, .lon_deg = 13.4};
        struct georef *georef = create(&spec);
        struct plan_row row;
        struct sh_err err;
        enum georef_method method;
        double ratio[ROUNDS];
        station_scatter(&p, 5, NEED.radius_m, NEED.height_m);
        assert_int_equal(plan_georef(georef, &NEED, &method, &row, &err), SH_OK);
        for (int r = 0; r < ROUNDS; r++) {
            double start_s = thread_s();
            georef_set_method(georef, GEOREF_EXACT, NULL);
            station_forward(georef, &p, p.exact);
            double exact_s = thread_s() - start_s;
            georef_set_method(georef, method, NULL);
            start_s = thread_s();
            for (int k = 0; k < TIMES; k++)
                station_forward(georef, &p, p.out);
            ratio[r] = exact_s * TIMES / (thread_s() - start_s);
        }
        georef_free(georef);
        qsort(ratio, ROUNDS, sizeof ratio[0], compare);
        print_message("# %s by %s: %.0f times as fast as exact\n", c == 0 ? "utm" : "geodetic", row.method,
                      ratio[ROUNDS / 2]);
        assert_true(ratio[ROUNDS / 2] >= 20.0);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_a_million_points),
        cmocka_unit_test(test_other_scene_frames),
        cmocka_unit_test(test_cost),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
