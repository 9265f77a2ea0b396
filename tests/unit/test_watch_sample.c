/* SPDX-License-Identifier: MIT */
/* The points of a scan that a page's figures are made of: where there are too many, those of every second pulse stay,
 * whole and in their order. And the page's scene, with bodies that move. */
#include <math.h>

#include "core/bytes.h"
#include "firmware_sim/app/studio/watch/inside.h"
#include "firmware_sim/base/clock.h"
#include "tests/unit/site_rig.h"

static struct watch w;

/* The scene is a quad. Of the watch only the sample is opened, with its index of distances. */
static void open_sample(void)
{
    write_in("quad.obj", "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4\n");
    write_in("test.yaml", "head: {profile: full-sweep}\nscene: {meshes: [{file: quad.obj, up: z, scale: 1}]}\n"
                          "stations: [{position_m: [0.5, 0.5, 1]}]\n");
    if (config_load(config_path, NULL, 0, cfg, &err) != SH_OK) fail_msg("%s", err.text);
    struct site *site;
    if (site_load_for(cfg, SITE_WRITTEN_OUT, NULL, NULL, &site, &err) != SH_OK) fail_msg("%s", err.text);
    memset(&w, 0, sizeof w);
    w.site = site;
    if (watch_sample_open(&w, &err) != SH_OK) fail_msg("%s", err.text);
    watch_sample_begin(&w);
    w.at = (struct watch_scan){.scan = 1, .station = 1};
    report_head_of(site, 0, &w.now);
}

static void close_sample(void)
{
    watch_sample_close(&w);
    site_free((struct site *)w.site);
}

/* Adds the point of a pulse; all that is known of it is made of the pulse's number. */
static void add(uint32_t pulse)
{
    struct watch_sample *s = &w.sample;
    watch_sample_add(&w, (const double[3]){pulse, pulse + 0.25, pulse + 0.5}, pulse);
    const size_t at = s->n - 1;
    if (s->hash[at] != pulse) return;
    s->distance_m[at] = pulse + 1.0;
    s->triangle[at] = pulse + 2;
    s->points.met[at] = pulse + 3;
    s->points.along_m[at] = (float)pulse + 4;
    s->points.sigma_m[at] = (float)pulse + 5;
    s->points.counts_m[at] = (float)pulse + 6;
    s->points.cosine[at] = (float)pulse + 7;
    s->points.range_m[at] = (float)pulse + 8;
}

static void expect_pulses(size_t n, uint32_t every)
{
    const struct watch_sample *s = &w.sample;
    assert_int_equal(s->every, every);
    assert_int_equal(s->n, n);
    for (uint32_t i = 0; i < n; i++) {
        const uint32_t pulse = i * every;
        const struct deviation_points *p = &s->points;
        const int whole = s->hash[i] == pulse && s->xyz_m[i][0] == pulse && s->xyz_m[i][1] == pulse + 0.25 &&
                          s->xyz_m[i][2] == pulse + 0.5 && s->distance_m[i] == pulse + 1.0 &&
                          s->triangle[i] == pulse + 2 && p->met[i] == pulse + 3 && p->along_m[i] == (float)pulse + 4 &&
                          p->sigma_m[i] == (float)pulse + 5 && p->counts_m[i] == (float)pulse + 6 &&
                          p->cosine[i] == (float)pulse + 7 && p->range_m[i] == (float)pulse + 8;
        if (!whole) fail_msg("point %u is not whole that of pulse %u", i, pulse);
    }
}

static void half_of_the_pulses_stay(void **state)
{
    (void)state;
    open_sample();
    for (uint32_t pulse = 0; pulse < WATCH_MOST_POINTS; pulse++)
        add(pulse);
    expect_pulses(WATCH_MOST_POINTS, 1); /* this many fit */
    w.sample.done = 1001;
    add(WATCH_MOST_POINTS + 1); /* it halves the sample, and is left out itself, since its pulse is odd */
    expect_pulses(WATCH_MOST_POINTS / 2, 2);
    assert_int_equal(w.sample.done, 501); /* pulses 0, 2 ... 1000 */
    add(WATCH_MOST_POINTS + 3);
    assert_int_equal(w.sample.n, WATCH_MOST_POINTS / 2);
    for (uint32_t pulse = WATCH_MOST_POINTS; pulse <= 2 * WATCH_MOST_POINTS; pulse += 2)
        add(pulse);
    expect_pulses(WATCH_MOST_POINTS / 2 + 1, 4); /* the last one made room, and stays */
    assert_int_equal(w.sample.done, 251);        /* 0, 4 ... 1000 */
    watch_sample_begin(&w);
    assert_true(w.sample.n == 0 && w.sample.done == 0 && w.sample.every == 1);
    close_sample();
}

/* At the least share a full sample passes further points over. */
static void a_full_sample_takes_no_more(void **state)
{
    (void)state;
    open_sample();
    for (uint32_t i = 0; i < WATCH_MOST_POINTS; i++)
        watch_sample_add(&w, (const double[3]){0, 0, 0}, 0);
    watch_sample_add(&w, (const double[3]){1, 1, 1}, 0);
    assert_int_equal(w.sample.n, WATCH_MOST_POINTS);
    assert_int_equal(w.sample.every, WATCH_LEAST_SHARE);
    close_sample();
}

/* ---- comparing: points above and below the quad, seen from 1 m above its middle */

static const double places[][3] = {{0.25, 0.5, 0}, {0.5, 0.25, 0.001}, {0.75, 0.5, -0.003}, {0.5, 0.75, 0.002}};
enum { N_PLACES = 4 };

static void add_places(void)
{
    for (int i = 0; i < N_PLACES; i++)
        watch_sample_add(&w, places[i], 0);
    w.at.points = N_PLACES;
}

static void same(const char *what, double a, double b, double tolerance)
{
    if (!(fabs(a - b) <= tolerance)) fail_msg("%s: %.12g is not %.12g", what, a, b);
}

/* The station is 1 m above the floor. A beam of length L to a point at height z meets the floor at L / (1 - z), so the
 * deviation along the beam is L - L / (1 - z), below 0 for z > 0. Floats round a deviation of 4 mm by 1e-10 m. */
static void points_are_compared_once(void **state)
{
    (void)state;
    const double mean_m = (0.001 + 0.003 + 0.002) / 4, rms_m = sqrt((1e-6 + 9e-6 + 4e-6) / 4);
    open_sample();
    add_places();
    assert_int_equal(watch_sample_compare(&w, &err), SH_OK);
    assert_int_equal(w.sample.done, N_PLACES);
    for (int i = 0; i < N_PLACES; i++) {
        const double z = places[i][2], range_m = hypot(0.25, 1 - z);
        same("distance", w.sample.distance_m[i], fabs(z), 1e-12);
        same("range", (double)w.sample.points.range_m[i], range_m, 1e-7);
        same("along", (double)w.sample.points.along_m[i], range_m - range_m / (1 - z), 1e-9);
        assert_true(w.sample.triangle[i] < 2 && w.sample.points.met[i] == w.sample.triangle[i]);
        w.sample.distance_m[i] += i == 0 ? 0.5 : 0; /* it is not looked at again */
    }
    assert_int_equal(watch_sample_compare(&w, &err), SH_OK);
    assert_true(w.sample.distance_m[0] == 0.5);
    w.sample.distance_m[0] = 0.0;
    w.at.over = 1;
    w.sample.every = 2;
    assert_int_equal(watch_sample_figures(&w, &err), SH_OK);
    assert_true(w.at.every == 2 && w.at.sampled_points == N_PLACES && w.at.expects);
    same("mean", w.at.figures.mean_m, mean_m, 1e-12);
    same("RMS", w.at.figures.rms_m, rms_m, 1e-12);
    same("largest", w.at.figures.max_m, 0.003, 1e-12);
    assert_memory_equal(w.at.max_at_m, places[2], sizeof places[2]);
    assert_true(w.at.histogram.from < 0.0); /* of deviations along the beam, which have signs */
    /* So few points have one cell, larger than the quad, and each stands for those of two pulses. */
    const double each = 2.0 * N_PLACES / (w.at.density_cell_m * w.at.density_cell_m);
    same("5 %", w.at.density.p5, each, 1e-4 * each);
    same("50 %", w.at.density.p50, each, 1e-4 * each);
    same("95 %", w.at.density.p95, each, 1e-4 * each);
    assert_true(w.at.density_cell_m > 1.0 && w.at.density.cells == 1 && w.sample.cell_m == w.at.density_cell_m);
    close_sample();
}

/* The beams of a head that moves do not come from one place. The sample is full here, up to the last point. */
static void a_head_that_moves_is_not_judged(void **state)
{
    (void)state;
    struct watch_sample *s = &w.sample;
    open_sample();
    ((struct site *)w.site)->moving = 1;
    for (uint32_t i = 0; i < WATCH_MOST_POINTS; i++)
        watch_sample_add(&w, places[i % N_PLACES], 0);
    s->done = WATCH_MOST_POINTS - N_PLACES;
    assert_int_equal(watch_sample_compare(&w, &err), SH_OK);
    for (int i = 0; i < N_PLACES; i++) {
        const size_t at = WATCH_MOST_POINTS - N_PLACES + (size_t)i;
        const struct deviation_points *p = &s->points;
        same("distance", s->distance_m[at], fabs(places[i][2]), 1e-12);
        assert_true(isnan(p->along_m[at]) && isnan(p->sigma_m[at]) && isnan(p->counts_m[at]) && isnan(p->cosine[at]) &&
                    isnan(p->range_m[at]) && p->met[at] == s->triangle[at]);
    }
    s->n = s->done = 0;
    add_places();
    assert_int_equal(watch_sample_compare(&w, &err), SH_OK);
    assert_int_equal(watch_sample_figures(&w, &err), SH_OK);
    assert_string_equal(w.at.verdict.text, "Not judged: the head moves.");
    assert_true(w.at.verdict.judgement == REPORT_NONE && w.at.verdict.judged == 0 && !w.at.expects);
    assert_true(w.at.figures.along == 0 && w.at.histogram.from == 0.0); /* of distances */
    ((struct site *)w.site)->moving = 0;
    close_sample();
}

/* Points that were compared cost time. Where that is next to none of the budget all stay, and where the budget is next
 * to nothing, the sample is thinned to the least share. */
static void the_sample_fits_the_budget(void **state)
{
    (void)state;
    for (int poor = 0; poor < 2; poor++) {
        open_sample();
        w.options.cpu_share = poor ? 1e-12 : 1e6;
        w.began_ns = clock_now_ns();
        w.began_thread_ns = clock_thread_ns();
        add_places();
        assert_int_equal(watch_sample_compare(&w, &err), SH_OK);
        assert_int_equal(w.sample.every, poor ? WATCH_LEAST_SHARE : 1);
        assert_true(w.sample.n == N_PLACES && w.sample.done == N_PLACES); /* their hash is 0 */
        assert_true(w.sample.spent_ns > 0 && w.sample.point_ns == w.sample.spent_ns / N_PLACES);
        watch_sample_begin(&w);
        assert_true(w.sample.spent_ns == 0.0 && w.sample.cell_m == REPORT_CELL_M);
        close_sample();
    }
}

/* ---- the scene */

/* The bodies of the page's scene are where they are at the first stop, 2 s after the trajectory's start. The first one
 * has then turned by 90 degrees, clockwise from above, about (5, 5), and moved by 2 m along x; the second by 1 m along
 * z. Corners are relative to the middle of what stands, (0.5, 0.5, 0). */
static void bodies_are_where_they_are_at_the_first_stop(void **state)
{
    (void)state;
    enum { N = 10, HEAD = 40 };
    static const float corner[N][3] = {{-0.5f, -0.5f, 0}, {0.5f, -0.5f, 0}, {0.5f, 0.5f, 0}, {-0.5f, 0.5f, 0},
                                       {6.5f, 3.5f, 0},   {6.5f, 2.5f, 0},  {7.5f, 3.5f, 0}, {-0.5f, -0.5f, 2},
                                       {0.5f, -0.5f, 2},  {-0.5f, 0.5f, 2}};
    static const uint32_t bodies[6] = {4, 5, 6, 7, 8, 9};
    struct site *site;
    struct web_body body;
    write_in("quad.obj", "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4\n");
    write_in("turns.obj", "v 6 5 0\nv 7 5 0\nv 6 6 0\nf 1 2 3\n");
    write_in("lifts.obj", "v 0 0 1\nv 1 0 1\nv 0 1 1\nf 1 2 3\n");
    write_in("test.yaml",
             "head: {profile: full-sweep}\nscene:\n  meshes:\n    - {file: quad.obj, up: z, scale: 1}\n"
             "    - {file: turns.obj, up: z, scale: 1, turn_deg_s: 45, pivot_m: [5, 5, 0], move_m_s: [1, 0, 0]}\n"
             "    - {file: lifts.obj, up: z, scale: 1, move_m_s: [0, 0, 0.5]}\n"
             "platform: {kind: stops, step_s: 1, start_s: 2, end_s: 2}\nstations: [{position_m: [0.5, 0.5, 1]}]\n");
    if (config_load(config_path, NULL, 0, cfg, &err) != SH_OK) fail_msg("%s", err.text);
    if (site_load_for(cfg, SITE_WRITTEN_OUT, NULL, NULL, &site, &err) != SH_OK) fail_msg("%s", err.text);
    memset(&w, 0, sizeof w);
    w.site = site;
    w.options.scene_triangles = 1000;
    if (watch_make_scene(&w, &err) != SH_OK || watch_get_scene(&w, &body, &err) != SH_OK) fail_msg("%s", err.text);
    const uint8_t *at = (const uint8_t *)body.bytes;
    assert_string_equal(body.type, "application/octet-stream");
    assert_int_equal(body.len, HEAD + 12 * N + 12 * 4);
    assert_int_equal(le_get32(at + 8), N);
    assert_int_equal(le_get32(at + 12), 4);
    assert_true(le_get_double(at + 16) == 0.5 && le_get_double(at + 24) == 0.5 && le_get_double(at + 32) == 0.0);
    for (int v = 0; v < N; v++)
        for (int i = 0; i < 3; i++) /* floats near 8 are rounded by 5e-7, and the turn is a few roundings of doubles */
            assert_true(fabs((double)(le_get_float(at + HEAD + 12 * v + 4 * i) - corner[v][i])) < 1e-6);
    for (int i = 0; i < 6; i++) /* after the quad's two triangles */
        assert_int_equal(le_get32(at + HEAD + 12 * N + 24 + 4 * i), bodies[i]);
    free(body.bytes);
    free(w.scene_bytes);
    site_free(site);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(half_of_the_pulses_stay),    cmocka_unit_test(a_full_sample_takes_no_more),
        cmocka_unit_test(points_are_compared_once),   cmocka_unit_test(a_head_that_moves_is_not_judged),
        cmocka_unit_test(the_sample_fits_the_budget), cmocka_unit_test(bodies_are_where_they_are_at_the_first_stop)};
    return cmocka_run_group_tests(tests, site_rig_setup, site_rig_teardown);
}
