/* SPDX-License-Identifier: MIT */
/* The figures of a page while a scan is on, as JSON: each key has its own figure. No two are the same, so exchanged
 * ones show. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "firmware_sim/app/studio/watch/inside.h"
#include "firmware_sim/config/places.h"

static struct config_station named[3] = {{.name = "first"}, {.name = "second"}, {.name = "third"}};
static struct site_station at[3] = {{.station = &named[0]}, {.station = &named[1]}, {.station = &named[2]}};
static const struct site site = {.station = at, .n_stations = 3};
static struct watch_scan of_station[3];
static struct watch w = {.site = &site, .shown_station = of_station};

static void fill(struct watch_scan *s)
{
    *s = (struct watch_scan){
        .scan = 7,
        .station = 2,
        .over = 1,
        .points = 1001,
        .shots = 400,
        .empty = 100,
        .left_out = 1002,
        .sampled_points = 1003,
        .every = 4,
        .figures = {11, 12, 13.5, 14.5, 15.5, 16.5, 17, 18.5, 19.5, 20.5, 21, 22.5, 23.5, 24.5, 25, 26.5, 27.5, 28.5},
        .max_at_m = {31, 32, 33},
        .density = {41, 42, 43.5, 44.5, 45.5},
        .density_cell_m = 0.2,
        .histogram = {.from = -1.5, .width = 0.5, .bins = 3, .count = {51, 52, 53}, .below = 54, .above = 55},
        .verdict = {.judgement = REPORT_WITHIN,
                    .judged = 61,
                    .beyond = 62,
                    .bound_m = 63.5,
                    .least_ratio = 64.5,
                    .most_ratio = 65.5,
                    .text = "Within."},
        .expected = {71.5, 72.5, 73.5, 74.5, 75.5, 76.5, {77.5, 78.5}, {79.5, 80.5}, 81.5, 82.5, {83, 84, 85}, 1},
        .expects = 1,
        .seen_share = 0.75};
}

static const char SCAN[] =
    "\"scan\":7,\"station\":2,\"over\":true,\"points\":1001,\"sampled_points\":1003,\"every\":4,\"left_out\":1002,"
    "\"shots\":400,\"empty_share\":0.25,"
    "\"expected\":{\"range_sigma_m\":71.5,\"range_sigma_per_m\":72.5,\"range_floor_m\":73.5,\"range_jitter_m\":74.5,"
    "\"range_step_m\":75.5,\"place_step_m\":76.5,\"angle_sigma_rad\":[77.5,78.5],\"angle_step_rad\":[79.5,80.5],"
    "\"ball_m\":81.5,\"ball_per_m\":82.5,\"ball_factor\":[83,84,85],\"ball_local\":true},"
    "\"all\":{\"points\":11,\"far\":12,\"mean_m\":13.5,\"rms_m\":14.5,\"p95_m\":15.5,\"max_m\":16.5,"
    "\"along_beam\":{\"points\":17,\"mean_m\":18.5,\"rms_m\":19.5,\"max_m\":20.5,\"judged\":21,\"judged_mean_m\":22.5,"
    "\"judged_rms_m\":23.5,\"expected_rms_m\":24.5,\"noisy\":25,\"mean_sigmas\":26.5,\"rms_sigmas\":27.5,"
    "\"counts_sigmas\":28.5},\"max_at\":[31,32,33],"
    "\"density\":{\"cells\":41,\"p5_m2\":43.5,\"p50_m2\":44.5,\"p95_m2\":45.5},\"density_cell_m\":0.2},"
    "\"verdict\":{\"judgement\":\"within\",\"text\":\"Within.\",\"judged\":61,\"beyond\":62,\"bound_m\":63.5,"
    "\"least_rms_sigmas\":64.5,\"most_rms_sigmas\":65.5}";

static void expect(const char *expected)
{
    struct web_body body;
    struct sh_err err;
    assert_int_equal(watch_get_quality(&w, &body, &err), SH_OK);
    assert_string_equal(body.bytes, expected);
    assert_int_equal(pthread_mutex_trylock(&w.lock), 0); /* the lock is given back */
    pthread_mutex_unlock(&w.lock);
    free(body.bytes);
}

static void each_key(void **state)
{
    char expected[8192];
    int some_cells;
    (void)state;
    fill(&w.shown);
    fill(&of_station[1]);
    fill(&of_station[2]);
    of_station[2].seen_share = NAN;
    w.seen = (struct watch_seen){.coverage = (struct coverage *)&some_cells, .cell_m = 0.25, .n_cells = 91};
    w.shown_seen = 92;
    w.shown_share = 0.125;
    w.lost_frames = 93;
    snprintf(expected, sizeof expected,
             "{%s,\"along_beam\":{\"from_m\":-1.5,\"width_m\":0.5,\"below\":54,\"above\":55,\"counts\":[51,52,53]},"
             "\"coverage\":{\"cell_m\":0.25,\"cells\":91,\"seen\":92,\"share\":0.125},\"lost_frames\":93,\"stations\":["
             "{\"number\":2,\"name\":\"second\",%s,\"seen_share\":0.75},"
             "{\"number\":3,\"name\":\"third\",%s,\"seen_share\":null}]}\n",
             SCAN, SCAN, SCAN);
    expect(expected);
}

/* The histogram is of deviations along the beam where one point has any, and of distances where none has. */
static void the_histogram_is_of_what_there_is(void **state)
{
    static const struct figures_histogram one = {.from = -1, .width = 2, .bins = 1, .count = {1}};
    (void)state;
    for (int along = 0; along < 2; along++) {
        struct web_body body;
        struct sh_err err;
        w.shown = (struct watch_scan){.scan = 1, .station = 1, .histogram = one, .figures.along = (size_t)along};
        assert_int_equal(watch_get_quality(&w, &body, &err), SH_OK);
        assert_non_null(strstr(body.bytes, along ? "\"along_beam\":{\"from_m\":-1," : "\"distances\":{\"from_m\":-1,"));
        free(body.bytes);
    }
}

/* Without a scan nothing is known, and nothing is made up. */
static void before_the_first_scan(void **state)
{
    (void)state;
    memset(&w.shown, 0, sizeof w.shown);
    memset(of_station, 0, sizeof of_station);
    w.seen.coverage = NULL;
    expect("{\"scan\":null,\"station\":null,\"over\":false,\"points\":0,\"sampled_points\":0,\"every\":null,"
           "\"left_out\":0,\"shots\":0,\"empty_share\":null,\"expected\":null,\"all\":null,\"verdict\":null,"
           "\"distances\":{\"from_m\":0,\"width_m\":0,\"below\":0,\"above\":0,\"counts\":[]},\"coverage\":null,"
           "\"lost_frames\":93,\"stations\":[]}\n");
}

static int open_lock(void **state)
{
    (void)state;
    return pthread_mutex_init(&w.lock, NULL);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(each_key), cmocka_unit_test(the_histogram_is_of_what_there_is),
                                       cmocka_unit_test(before_the_first_scan)};
    return cmocka_run_group_tests(tests, open_lock, NULL);
}
