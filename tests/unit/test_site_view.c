/* SPDX-License-Identifier: MIT */
/* The directions that a scan may look to: its window of line and pan angles, with a margin of 2e-3 rad (0.1146 deg) and
 * the head's own errors. Azimuths count clockwise from y. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

#include "core/angle.h"
#include "core/instrument.h"
#include "firmware_sim/config/config.h"
#include "firmware_sim/site/site.h"
#include "firmware_sim/site/view.h"

static const double MARGIN_DEG = 2e-3 * 180 / M_PI;
static struct site *site;
static struct config *cfg;
static struct site_station station;

static int set_up(void **state)
{
    (void)state;
    site = calloc(1, sizeof *site);
    cfg = calloc(1, sizeof *cfg);
    if (site == NULL || cfg == NULL) return -1;
    site->cfg = cfg;
    site->station = &station;
    for (int i = 0; i < 3; i++)
        station.at.rotation[4 * i] = 1.0;
    return 0;
}

static int tear_down(void **state)
{
    (void)state;
    free(site);
    free(cfg);
    return 0;
}

static struct site_view view_of(double line_from_deg, double line_to_deg, double pan_from_deg, double pan_to_deg)
{
    struct site_view view;
    struct head_settings *s = &cfg->head.settings;
    s->line_start_udeg = llround(1e6 * line_from_deg);
    s->line_stop_udeg = llround(1e6 * line_to_deg);
    s->pan_start_udeg = llround(1e6 * pan_from_deg);
    s->pan_stop_udeg = llround(1e6 * pan_to_deg);
    s->lines_uhz = 100000000;
    s->pan_udeg_s = 20000000; /* 0.2 deg a line */
    memset(&view, 0xee, sizeof view);
    site_view_of(site, 0, &view);
    return view;
}

static int sees(const struct site_view *view, double elevation_deg, double azimuth_deg, double radius_deg)
{
    const double e = angle_rad(elevation_deg), a = angle_rad(azimuth_deg);
    return site_view_sees(view, (const double[3]){sin(a) * cos(e), cos(a) * cos(e), sin(e)}, angle_rad(radius_deg));
}

/* Just within and just beyond an edge. */
static void expect_edge(const struct site_view *view, double elevation_deg, double azimuth_deg, double up, double right)
{
    for (int beyond = 0; beyond < 2; beyond++) {
        const double by = beyond ? 1e-3 : -1e-3;
        if (sees(view, elevation_deg + up * by, azimuth_deg + right * by, 0.0) == beyond)
            fail_msg("%g deg up, %g deg right: %d", elevation_deg, azimuth_deg, !beyond);
    }
}

/* The pan stops at most a line (0.2 deg) beyond its window. At the horizon azimuths have an elevation's margin. */
static void a_window_has_four_edges(void **state)
{
    (void)state;
    const struct site_view view = view_of(-40, 60, 10, 20);
    assert_int_equal(view.n, 1);
    expect_edge(&view, -40 - MARGIN_DEG, 15, -1, 0);
    expect_edge(&view, 60 + MARGIN_DEG, 15, 1, 0);
    expect_edge(&view, 0, 10 - MARGIN_DEG, 0, -1);
    expect_edge(&view, 0, 20.2 + MARGIN_DEG, 0, 1);
    expect_edge(&view, 0, 10 - MARGIN_DEG - 360, 0, -1); /* a turn away */
    assert_false(sees(&view, 0, 195, 0));
    assert_true(sees(&view, 65, 15, 5) && !sees(&view, 65, 15, 4.8)); /* a cap of that radius */
}

/* Beyond 90 deg a line looks backward, and below -90 deg, too. */
static void lines_beyond_the_zenith_look_backward(void **state)
{
    (void)state;
    struct site_view view = view_of(30, 140, 0, 10);
    assert_int_equal(view.n, 2);
    expect_edge(&view, 30 - MARGIN_DEG, 5, -1, 0);
    expect_edge(&view, 40 - MARGIN_DEG, 185, -1, 0);
    assert_true(sees(&view, 80, 5, 0) && sees(&view, 80, 185, 0) && !sees(&view, 35, 185, 0));
    view = view_of(-100, -80, 0, 10);
    assert_int_equal(view.n, 2);
    expect_edge(&view, -80 + MARGIN_DEG, 5, 1, 0);
    expect_edge(&view, -80 + MARGIN_DEG, 185, 1, 0);
    view = view_of(100, 200, 0, 10); /* from the back down to the horizon, and below it */
    assert_int_equal(view.n, 1);
    expect_edge(&view, 80 + MARGIN_DEG, 185, 1, 0);
    expect_edge(&view, -20 - MARGIN_DEG, 185, -1, 0);
    assert_false(sees(&view, 50, 5, 0));
}

static void a_pan_that_stands_has_one_azimuth(void **state)
{
    (void)state;
    struct site_view view = view_of(-40, 60, 30, 30);
    expect_edge(&view, 0, 30 + MARGIN_DEG, 0, 1);
    expect_edge(&view, 0, 30 - MARGIN_DEG, 0, -1);
    cfg->head.settings.pan_stop_udeg = 40000000;
    cfg->head.settings.pan_udeg_s = 0;
    site_view_of(site, 0, &view);
    expect_edge(&view, 0, 30 + MARGIN_DEG, 0, 1);
}

/* Collimation, trunnion, and seven sigmas of each angle's noise, which no drawn noise exceeds. */
static void a_heads_errors_widen_it(void **state)
{
    (void)state;
    const struct instrument k = {
        .collimation_rad = -1e-3, .trunnion_rad = 2e-3, .mirror_sigma_rad = 3e-4, .pan_sigma_rad = 1e-4};
    site->detect.cast.instrument = &k;
    const struct site_view view = view_of(-40, 60, 10, 20);
    assert_true(fabs(view.margin_rad - (2e-3 + 1e-3 + 2e-3 + 7 * 4e-4)) < 1e-15);
    site->detect.cast.instrument = NULL;
}

static void other_heads_look_where_they_fire(void **state)
{
    (void)state;
    struct site_view view;
    struct sh_err err;
    emitter_set_planar(&site->emitter, 1440, 0, 1080, 540, 1);
    view = view_of(0, 0, 0, 0);
    assert_int_equal(view.n, 1);
    expect_edge(&view, MARGIN_DEG, 100, 1, 0);
    expect_edge(&view, -MARGIN_DEG, 260, -1, 0);
    const struct emitter_beam beam[2] = {{-15000000, 0, 0}, {5000000, 0, 10}};
    assert_int_equal(emitter_set_beams(&site->emitter, beam, 2, 100000, 1, &err), SH_OK);
    view = view_of(0, 0, 0, 0);
    assert_int_equal(view.n, 2);
    expect_edge(&view, -15 - MARGIN_DEG, 0, -1, 0);
    expect_edge(&view, 5 + MARGIN_DEG, 180, 1, 0);
    assert_false(sees(&view, -5, 90, 0));
    emitter_set_sphere(&site->emitter, 1000000);
    assert_int_equal(emitter_set_rings(&site->emitter, -10000000, 20000000, &err), SH_OK);
    view = view_of(350, 40, 0, 0); /* across 0 */
    assert_int_equal(view.n, 1);
    expect_edge(&view, -10 - MARGIN_DEG, 0, -1, 0);
    expect_edge(&view, 20 + MARGIN_DEG, 0, 1, 0);
    expect_edge(&view, 0, 350 - MARGIN_DEG, 0, -1);
    expect_edge(&view, 0, 40 + MARGIN_DEG, 0, 1);
    emitter_set_directions(&site->emitter, NULL, 5);
    view = view_of(0, 360, 0, 0);
    assert_true(view.n == 1 && sees(&view, 90, 0, 0) && sees(&view, -90, 0, 0) && sees(&view, 7, 123, 0));
    memset(&site->emitter, 0, sizeof site->emitter);
}

/* The share of a band of elevations is that of its area, (sin b - sin a) / 2; 2048 directions count it to 1e-3. The
 * station's rotation turns the view. */
static void the_share_is_that_of_the_area(void **state)
{
    (void)state;
    const double low = angle_rad(-40 - MARGIN_DEG), high = angle_rad(60 + MARGIN_DEG);
    struct site_view view = view_of(-40, 60, 0, 360);
    assert_true(fabs(site_view_share(&view, 0.0) - 0.5 * (sin(high) - sin(low))) < 1e-3);
    assert_true(fabs(site_view_share(&view, 0.1) - 0.5 * (sin(high + 0.1) - sin(low - 0.1))) < 1e-3);
    static const double east[9] = {0, 1, 0, -1, 0, 0, 0, 0, 1}; /* forward is x */
    memcpy(station.at.rotation, east, sizeof east);
    view = view_of(-40, 60, 10, 20);
    assert_true(sees(&view, 0, 105, 0) && !sees(&view, 0, 15, 0));
    assert_true(site_scans(site, 0, (const double[3]){sin(0.26), cos(0.26), 0}));  /* 15 deg in the head's own frame */
    assert_false(site_scans(site, 0, (const double[3]){sin(0.17), cos(0.17), 0})); /* 9.7 deg: no margin here */
    for (int i = 0; i < 9; i++)
        station.at.rotation[i] = i % 4 == 0;
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_window_has_four_edges),           cmocka_unit_test(lines_beyond_the_zenith_look_backward),
        cmocka_unit_test(a_pan_that_stands_has_one_azimuth), cmocka_unit_test(a_heads_errors_widen_it),
        cmocka_unit_test(other_heads_look_where_they_fire),  cmocka_unit_test(the_share_is_that_of_the_area),
    };
    return cmocka_run_group_tests_name("site view", tests, set_up, tear_down);
}
