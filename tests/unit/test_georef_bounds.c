/* SPDX-License-Identifier: MIT */
/* Bounds of georeferencing where the scene's frame is not level: a place far along it may be high above the ground. */
#include "core/angle.h"
#include "core/geoframe.h"
#include "tests/unit/georef_rig.h"

enum { POINTS = 48 };
static const double RADIUS_M = 2000, HEIGHT_M = 20;

/* The scene's x axis is tilted upward from east by so many degrees, and y stays north. */
static struct georef *make_tilted(enum georef_crs crs, double lat_deg, double tilt_deg)
{
    const double s = sin(angle_rad(tilt_deg)), c = cos(angle_rad(tilt_deg));
    struct georef_spec spec = {
        .crs = crs, .lat_deg = lat_deg, .lon_deg = 9, .height_m = 100, .rotation = {c, 0, -s, 0, 1, 0, s, 0, c}};
    struct georef *georef = NULL;
    struct sh_err err = {0, ""};
    if (georef_create(&spec, &georef, &err) != SH_OK) fail_msg("%s", err.text);
    return georef;
}

/* Points are on the edges of the cylinder. Degrees are converted by the ellipsoid's least radius, so that errors are
 * not overestimated. */
static double largest_error_m(struct georef *georef, enum georef_method method, double lat_deg, double radius_m)
{
    const double degree_m = angle_rad(6335000.0);
    double largest_m = 0;
    for (int i = 0; i < POINTS; i++) {
        const double turn = 2 * PI * i / POINTS;
        const double d[3] = {radius_m * cos(turn), radius_m * sin(turn), i % 2 ? HEIGHT_M : -HEIGHT_M};
        double exact[3], got[3];
        assert_int_equal(georef_set_method(georef, GEOREF_EXACT, NULL), SH_OK);
        forward_one(georef, d, exact);
        assert_int_equal(georef_set_method(georef, method, NULL), SH_OK);
        forward_one(georef, d, got);
        double e[3] = {got[0] - exact[0], got[1] - exact[1], got[2] - exact[2]};
        if (georef_crs(georef) == GEOREF_GEODETIC) {
            e[0] *= degree_m;
            e[1] *= degree_m * cos(angle_rad(lat_deg));
        }
        largest_m = fmax(largest_m, sqrt(e[0] * e[0] + e[1] * e[1] + e[2] * e[2]));
    }
    return largest_m;
}

static void test_tilted(void **state)
{
    (void)state;
    static const double lat_deg[] = {0, 47, -70}, tilt_deg[] = {0, 30, 90};
    for (int i = 0; i < 3 * 3 * 2; i++) {
        const enum georef_crs crs = i % 2 ? GEOREF_GEODETIC : GEOREF_UTM;
        const double lat = lat_deg[i / 2 % 3], tilt = tilt_deg[i / 6];
        struct georef *georef = make_tilted(crs, lat, tilt);
        for (enum georef_method m = GEOREF_ORDER1; m <= GEOREF_ORDER3; m++) {
            const double error_m = largest_error_m(georef, m, lat, RADIUS_M),
                         bound_m = georef_bound_m(georef, m, RADIUS_M, HEIGHT_M);
            if (!(error_m <= bound_m))
                fail_msg("latitude %g, tilted by %g, EPSG %d, order %d: off by %.3g m, bound %.3g m", lat, tilt,
                         georef_epsg(georef), 1 + (int)m - (int)GEOREF_ORDER1, error_m, bound_m);
            /* The bound is not much too large. It takes a turned cylinder as a ball, and adds up terms of orders. */
            assert_true(m != GEOREF_ORDER1 || bound_m < 10 * error_m);
        }
        georef_free(georef);
    }
}

/* Scenes lie in a polar grid, at both poles and all around, and their points become degrees. */
static void test_polar_grids(void **state)
{
    (void)state;
    static const double lon_deg[] = {0, 75, -160};
    for (int i = 0; i < 6; i++) {
        const struct georef_place at = {i % 2 ? 86 : -86, lon_deg[i / 2], 100};
        struct geoframe frame;
        struct georef_spec spec = {.crs = GEOREF_GEODETIC};
        struct georef *georef = NULL;
        struct sh_err err = {0, ""};
        double p[3];
        int rc = geoframe_set_grid(&frame, 0, i % 2, &err);
        if (rc == SH_OK) rc = geoframe_find(&frame, &at, p, &err);
        if (rc == SH_OK) rc = geoframe_fill(&frame, p, &spec, &err);
        if (rc == SH_OK) rc = georef_create(&spec, &georef, &err);
        if (rc != SH_OK) fail_msg("%s", err.text);
        for (enum georef_method m = GEOREF_ORDER1; m <= GEOREF_ORDER3; m++) {
            const double error_m = largest_error_m(georef, m, at.lat_deg, RADIUS_M),
                         bound_m = georef_bound_m(georef, m, RADIUS_M, HEIGHT_M);
            assert_true(isfinite(bound_m));
            if (!(error_m <= bound_m))
                fail_msg("latitude %g, longitude %g: off by %.3g m, bound %.3g m", at.lat_deg, at.lon_deg, error_m,
                         bound_m);
        }
        georef_free(georef);
    }
}

/* A scene in a UTM grid, whose points go to the grid of the next zone. Heights stay the same, and order 5 is tested,
 * too. The error of order 5 shows only in a large scene. */
static void test_next_grid(void **state)
{
    (void)state;
    static const double lat_deg[] = {5, 48, -60}, radius_m[] = {2000, 20000};
    for (int i = 0; i < 12; i++) {
        const struct georef_place at = {lat_deg[i % 3], i / 6 ? 11.5 : 6.5, 100};
        const double radius = radius_m[i / 3 % 2];
        struct geoframe frame;
        struct georef_spec spec = {.crs = GEOREF_UTM, .utm_zone = i / 6 ? 33 : 31};
        struct georef *georef = NULL;
        struct sh_err err = {0, ""};
        double p[3], before_m = INFINITY;
        int rc = geoframe_set_grid(&frame, 32, at.lat_deg > 0, &err);
        if (rc == SH_OK) rc = geoframe_find(&frame, &at, p, &err);
        if (rc == SH_OK) rc = geoframe_fill(&frame, p, &spec, &err);
        if (rc == SH_OK) rc = georef_create(&spec, &georef, &err);
        if (rc != SH_OK) fail_msg("%s", err.text);
        for (enum georef_method m = GEOREF_ORDER1; m <= GEOREF_ORDER5; m++) {
            const double error_m = largest_error_m(georef, m, at.lat_deg, radius),
                         bound_m = georef_bound_m(georef, m, radius, HEIGHT_M);
            if (!(error_m <= bound_m && bound_m <= before_m))
                fail_msg("latitude %g, %g m, method %d: off by %.3g m, bound %.3g m", at.lat_deg, radius, (int)m,
                         error_m, bound_m);
            before_m = bound_m;
        }
        georef_free(georef);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_tilted), cmocka_unit_test(test_polar_grids),
                                       cmocka_unit_test(test_next_grid)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
