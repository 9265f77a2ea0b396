/* SPDX-License-Identifier: MIT */
/* Where to stand next: which places are scanned, which one is chosen, and what is kept of it. The estimates, the scans
 * and the cells are the test's; place i is at x = i. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

#include "core/angle.h"
#include "core/pose.h"
#include "firmware_sim/app/studio/coverage/next.h"
#include "firmware_sim/config/profile.h"
#include "tests/unit/trace_rig.h"

enum { MOST = 8 };

static const struct config_profile profile = {.range_min_m = 1.5, .range_max_m = 70.0};
static struct coverage_result_station station[2];
static struct site site = {.n_stations = 2};
static struct coverage_next_options options;
static struct coverage_result result;
static struct coverage_next next;
static struct coverage_finder finder;
static struct coverage *const coverage = (struct coverage *)&result;
static const struct sh_report report;

static double estimate_m2[MOST], front[MOST], gain_m2[MOST]; /* by place; gain_m2: of a scan */
static uint32_t looked;                                      /* the place of the scan that waits */
static int gains_fail, look_fails_at, n_looks;
static double turned[3]; /* the last direction of the last estimate */
static const struct cast_tripod *tripod;
static struct cast_tripod seen_tripod;
static double rotation[9];

const struct config_profile *site_profile(const struct site *of)
{
    assert_ptr_equal(of, &site);
    return &profile;
}

void coverage_scan_of(const struct site *of, uint32_t base, struct coverage_scan_at *at)
{
    assert_ptr_equal(of, &site);
    assert_int_equal(base, 4);
    memset(at, 0, sizeof *at);
    at->scan.setup.tripod = tripod;
    at->scan.setup.sight = (const void *)&site;
}

int coverage_gains(const struct coverage *of, const struct coverage_directions *d, const struct coverage_places *places,
                   const struct sh_report *to, struct coverage_gain *gain, struct sh_err *err)
{
    assert_true(of == coverage && to == &report && places->cells == NULL);
    assert_true(d->n == finder.n_dir && d->each_sr == finder.each_sr);
    assert_true(d->range_min_m == 1.5 && d->range_max_m == 70.0);
    memcpy(turned, d->dir[d->n - 1], sizeof turned);
    say("estimate");
    for (uint32_t i = 0; i < places->n; i++) {
        const uint32_t place = (uint32_t)places->place_m[i][0];
        assert_true(places->place_m[i][1] == 10.0 && places->place_m[i][2] == 20.0);
        say(":%u", place);
        gain[i] = (struct coverage_gain){estimate_m2[place], front[place]};
    }
    say(" ");
    return gains_fail ? sh_fail(err, SH_ENOMEM, "no gains") : SH_OK;
}

int coverage_look(struct coverage *of, const struct coverage_scan *scan, const char *what, const struct sh_report *to,
                  struct coverage_pulses *pulses, struct sh_err *err)
{
    const struct cast_setup *setup = &scan->setup;
    assert_true(of == coverage && to == &report && setup->bvh == site.bvh && setup->sight == NULL && pulses != NULL);
    assert_true(setup->station_m[1] == 10.0 && setup->station_m[2] == 20.0);
    assert_int_equal(setup->tripod == NULL, tripod == NULL);
    if (tripod != NULL) seen_tripod = *setup->tripod;
    memcpy(rotation, setup->rotation, sizeof rotation);
    looked = (uint32_t)setup->station_m[0];
    say("%s:%u ", what, looked);
    return ++n_looks == look_fails_at ? sh_fail(err, SH_ESTOPPED, "stopped") : SH_OK;
}

void coverage_waiting(const struct coverage *of, double *seen, double *gain)
{
    assert_ptr_equal(of, coverage);
    *seen = 100.0 + looked;
    *gain = gain_m2[looked];
}

void coverage_keep(struct coverage *of)
{
    assert_ptr_equal(of, coverage);
    say("keep:%u ", looked);
    for (uint32_t i = 0; i < MOST; i++) /* all others gain half of it less */
        gain_m2[i] = i == looked ? 0.0 : gain_m2[i] - 0.5 * gain_m2[looked];
}

uint32_t coverage_cells(const struct coverage *of)
{
    return of == coverage ? 4 : 0;
}

void coverage_get(const struct coverage *of, uint32_t cell, struct coverage_cell *out)
{
    static const struct coverage_cell cells[] = {
        {.area_m2 = 1.5}, {.area_m2 = 4.0, .stations = 1}, {.area_m2 = 16.0, .stations = 2}, {.area_m2 = 2.25}};
    *out = cells[of == coverage ? cell : 1];
}

/* n places, all with heading 0. */
static void begin(uint32_t n)
{
    static const double dir[][3] = {{0, 0, 1}, {1, 2, 3}};
    site.bvh = (struct bvh *)&site;
    memset(station, 0, sizeof station);
    options = (struct coverage_next_options){.stations = 1, .scans = 2};
    result = (struct coverage_result){.site = &site, .base = 4, .station = station};
    next = (struct coverage_next){.n = n, .place = calloc(n, sizeof *next.place)};
    finder = (struct coverage_finder){
        .o = &options, .result = &result, .site = &site, .report = &report, .next = &next, .n_dir = 2};
    finder.dir = malloc(sizeof dir);
    finder.each_sr = calloc(2, sizeof *finder.each_sr);
    assert_true(next.place != NULL && finder.dir != NULL && finder.each_sr != NULL);
    memcpy(finder.dir, dir, sizeof dir);
    for (uint32_t i = 0; i < n; i++)
        memcpy(next.place[i].position_m, (double[]){i, 10, 20}, sizeof next.place[i].position_m);
    for (int i = 0; i < MOST; i++) {
        estimate_m2[i] = gain_m2[i] = 0.0;
        front[i] = 1.0;
    }
    trace[0] = '\0';
    gains_fail = look_fails_at = n_looks = 0;
    tripod = NULL;
}

static void set(double *to, const double *values, int n)
{
    memcpy(to, values, (size_t)n * sizeof *to);
}
#define SET(to, ...) set(to, (const double[]){__VA_ARGS__}, sizeof((const double[]){__VA_ARGS__}) / sizeof(double))

static void find(const char *expected)
{
    struct sh_err err;
    assert_int_equal(coverage_next_find(&finder, coverage, &err), SH_OK);
    assert_string_equal(trace, expected);
}

static void end(void)
{
    coverage_next_free(&next, &finder);
}

static void expect_tried(const struct coverage_next_round *round, uint32_t i, uint32_t place, double m2)
{
    assert_true(i < round->n_tried);
    assert_int_equal(round->tried[i].place, place);
    assert_true(round->tried[i].gain_m2 == m2 && round->tried[i].seen_m2 == 100.0 + place);
}

/* The places with the largest estimates are scanned, and the one whose scan gains most is chosen. */
static void the_best_scan_is_chosen(void **state)
{
    (void)state;
    begin(4);
    SET(estimate_m2, 1, 3, 2, 0);
    SET(gain_m2, 9, 2.5, 2.75, 9);
    find("estimate:0:1:2:3 next station 1, scan 1 of 2:1 next station 1, scan 2 of 2:2 keep:2 ");
    assert_true(next.n_asked == 1 && next.n_rounds == 1 && next.round[0].n_tried == 2);
    expect_tried(&next.round[0], 0, 2, 2.75);
    expect_tried(&next.round[0], 1, 1, 2.5);
    assert_true(next.round[0].none_m2 == 1.5 + 2.25); /* of cells that no station sees */
    for (uint32_t i = 0; i < 4; i++) {
        assert_true(next.estimate_m2[i] == estimate_m2[i]);
        assert_int_equal(next.place[i].state, i == 2 ? COVERAGE_PLACE_CHOSEN : COVERAGE_PLACE_OPEN);
    }
    end();
    begin(4); /* it is scanned again where another scan came after it */
    SET(estimate_m2, 1, 3, 2, 0);
    SET(gain_m2, 9, 3, 2.75, 9);
    find("estimate:0:1:2:3 next station 1, scan 1 of 2:1 next station 1, scan 2 of 2:2 next station, once more:1 "
         "keep:1 ");
    expect_tried(&next.round[0], 0, 1, 3);
    expect_tried(&next.round[0], 1, 2, 2.75);
    end();
}

/* The first one counts where places are equal. */
static void equal_places(void **state)
{
    (void)state;
    begin(3);
    options.scans = 3;
    SET(estimate_m2, 2, 3, 3);
    SET(gain_m2, 7, 7, 7);
    find(
        "estimate:0:1:2 next station 1, scan 1 of 3:1 next station 1, scan 2 of 3:2 next station 1, scan 3 of 3:0 next "
        "station, once more:1 keep:1 ");
    for (uint32_t i = 0; i < 3; i++)
        expect_tried(&next.round[0], i, (const uint32_t[]){1, 2, 0}[i], 7);
    end();
}

static void nothing_to_gain(void **state)
{
    (void)state;
    begin(2);
    find("estimate:0:1 ");
    assert_true(next.n_asked == 1 && next.n_rounds == 0 && next.round[0].n_tried == 0);
    end();
    begin(2);
    options.stations = 2;
    SET(estimate_m2, 0, 1e-9);
    find("estimate:0:1 next station 1, scan 1 of 2:1 ");
    assert_true(next.n_asked == 2 && next.n_rounds == 0 && next.round[0].n_tried == 1);
    assert_int_equal(next.place[1].state, COVERAGE_PLACE_OPEN);
    assert_true(next.round[0].none_m2 == 0.0);
    end();
}

/* A place is chosen once. A later round estimates the others anew. */
static void several_rounds(void **state)
{
    (void)state;
    begin(3);
    options.stations = 3;
    options.scans = 1;
    SET(estimate_m2, 1, 2, 3);
    SET(gain_m2, 4, 6, 8);
    find("estimate:0:1:2 next station 1, scan 1 of 1:2 keep:2 estimate:0:1 next station 2, scan 1 of 1:1 keep:1 "
         "estimate:0 next station 3, scan 1 of 1:0 ");
    assert_true(next.n_asked == 3 && next.n_rounds == 2);
    expect_tried(&next.round[0], 0, 2, 8);
    expect_tried(&next.round[1], 0, 1, 2);
    expect_tried(&next.round[2], 0, 0, -1);
    static const double rows[] = {1, 2, 3, 1, 2, 0, 1, 0, 0};
    for (int i = 0; i < 9; i++)
        assert_true(next.estimate_m2[i] == rows[i]);
    end();
}

/* Places of one heading share their directions, which turn clockwise from above: 90 degrees bring y to x. */
static void headings(void **state)
{
    double expected[9];
    (void)state;
    begin(4);
    options.scans = 1;
    next.place[1].heading_deg = next.place[3].heading_deg = 90.0;
    SET(estimate_m2, 1, 1, 1, 2);
    SET(gain_m2, 1, 1, 1, 1);
    find("estimate:0:2 estimate:1:3 next station 1, scan 1 of 1:3 keep:3 ");
    assert_true(fabs(turned[0] - 2.0) < 1e-15 && fabs(turned[1] + 1.0) < 1e-15 && turned[2] == 3.0);
    pose_heading(angle_rad(90.0), expected);
    assert_memory_equal(rotation, expected, sizeof expected);
    end();
    begin(1);
    next.place[0].heading_deg = 30.0; /* of 1, 2: cos 30 = 0.8660254, sin 30 = 0.5 */
    find("estimate:0 ");
    assert_true(fabs(turned[0] - 1.8660254037844386) < 1e-15 && fabs(turned[1] - 1.2320508075688772) < 1e-15);
    end();
}

/* The cone below a head goes with it, and the legs of a tripod do not. */
static void tripods(void **state)
{
    const struct cast_tripod with_legs = {.down = {0, 0, -1}, .cos_opening = 0.75, .has_legs = 1};
    (void)state;
    begin(1);
    SET(estimate_m2, 1);
    tripod = &with_legs;
    find("estimate:0 next station 1, scan 1 of 2:0 ");
    assert_true(seen_tripod.cos_opening == 0.75 && seen_tripod.down[2] == -1.0 && seen_tripod.has_legs == 0);
    end();
}

/* Where at least half of the stations' hits are fronts of faces, a place that sees fewer than half is within a body.
 * A place that sees nothing is not. Places that a user names are never left out. */
static void places_within_bodies(void **state)
{
    static const struct {
        uint64_t fronts[2];
        const char *candidates;
        int leaves_out;
    } rows[] = {{{2, 3}, NULL, 1}, {{2, 2}, NULL, 0}, {{6, 4}, NULL, 1}, {{6, 4}, "places.csv", 0}};
    (void)state;
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        begin(4);
        options.candidates = rows[i].candidates;
        options.stations = options.scans = 1;
        station[0].pulses = (struct coverage_pulses){.hits = 6, .front = rows[i].fronts[0]};
        station[1].pulses = (struct coverage_pulses){.hits = 4, .front = rows[i].fronts[1]};
        SET(estimate_m2, 5, 4, 0, 6);
        SET(front, 0.49, 0.5, NAN, 0.0);
        find(rows[i].leaves_out ? "estimate:0:1:2:3 next station 1, scan 1 of 1:1 "
                                : "estimate:0:1:2:3 next station 1, scan 1 of 1:3 ");
        assert_int_equal(next.within, rows[i].leaves_out ? 2 : 0);
        for (int k = 0; k < 4; k++) {
            const int is_out = rows[i].leaves_out && (k == 0 || k == 3);
            assert_int_equal(next.place[k].state, is_out ? COVERAGE_PLACE_WITHIN : COVERAGE_PLACE_OPEN);
            assert_true(next.estimate_m2[k] == (is_out ? 0.0 : estimate_m2[k]));
            assert_true(isnan(front[k]) ? isnan(next.place[k].front) : next.place[k].front == front[k]);
        }
        end();
    }
    begin(2); /* later rounds leave no more out */
    options.stations = 2;
    options.scans = 1;
    SET(estimate_m2, 1, 2);
    SET(gain_m2, 5, 6);
    SET(front, 1, 1);
    struct sh_err err;
    assert_int_equal(coverage_next_find(&finder, coverage, &err), SH_OK);
    assert_int_equal(next.within, 0);
    end();
}

static void errors(void **state)
{
    struct sh_err err;
    (void)state;
    begin(2);
    gains_fail = 1;
    assert_int_equal(coverage_next_find(&finder, coverage, &err), SH_ENOMEM);
    assert_string_equal(err.text, "no gains");
    assert_string_equal(trace, "estimate:0:1 ");
    end();
    for (look_fails_at = 1; look_fails_at <= 3; look_fails_at++) {
        const int at = look_fails_at;
        begin(2);
        look_fails_at = at;
        SET(estimate_m2, 2, 1);
        SET(gain_m2, 2, 1);
        assert_int_equal(coverage_next_find(&finder, coverage, &err), SH_ESTOPPED);
        assert_int_equal(n_looks, at);
        assert_true(next.n_rounds == 0 && next.place[0].state == COVERAGE_PLACE_OPEN);
        assert_null(strstr(trace, "keep"));
        end();
    }
}

static void areas(void **state)
{
    static const struct {
        const char *text;
        int is_right;
    } rows[] = {{"0,1,2,3", 1},   {"0,1,2,3,4,5", 1}, {"0,1,2,3,4,4", 1},  {"0,1,2,3,5,4", 0},
                {"0,1,0,3", 0},   {"0,1,2,1", 0},     {"2,1,0,3", 0},      {"0,3,2,1", 0},
                {"0,1,2,3,4", 0}, {"0,1,2", 0},       {"0,1,2,3,", 0},     {"a,1,2,3", 0},
                {"", 0},          {"-2,-3,-1,-2", 1}, {"0,1,2,3,4,5,6", 0}};
    double area_m[2][3];
    (void)state;
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++)
        if (coverage_next_area(rows[i].text, area_m) != rows[i].is_right) fail_msg("%s", rows[i].text);
    assert_int_equal(coverage_next_area("0,1,2,3,4,5", area_m), 1);
    assert_memory_equal(area_m, ((const double[2][3]){{0, 1, 4}, {2, 3, 5}}), sizeof area_m);
    assert_int_equal(coverage_next_area("0,1,2,3", area_m), 1);
    assert_true(isnan(area_m[0][2]) && isnan(area_m[1][2]));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_best_scan_is_chosen), cmocka_unit_test(equal_places), cmocka_unit_test(nothing_to_gain),
        cmocka_unit_test(several_rounds),          cmocka_unit_test(headings),     cmocka_unit_test(tripods),
        cmocka_unit_test(places_within_bodies),    cmocka_unit_test(errors),       cmocka_unit_test(areas),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
