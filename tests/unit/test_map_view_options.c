/* SPDX-License-Identifier: MIT */
/* The options of map --perspective as a plan: the compass, places, sizes and limits, up to their bounds. */
#include "firmware_sim/app/studio/map/view.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdint.h>
#include <string.h>
#include <cmocka.h>

static struct map_view_plan plan;
static struct sh_err err;

static void reads(const struct map_view_options *o)
{
    memset(&plan, 0x5a, sizeof plan);
    if (map_view_read(o, &plan, &err) != SH_OK) fail_msg("%s", err.text);
}

static void without_options_there_are_defaults(void **state)
{
    (void)state;
    reads(&map_view_default);
    assert_int_equal(plan.colour, MAP_VIEW_HEIGHT);
    assert_true(fabs(plan.azimuth_rad - 1.25 * M_PI) < 1e-12); /* south-west */
    assert_true(fabs(plan.elevation_rad - 40.0 / 180.0 * M_PI) < 1e-12);
    assert_true(fabs(plan.camera.fov_rad - 40.0 / 180.0 * M_PI) < 1e-12);
    assert_true(plan.camera.width == 1200 && plan.camera.height == 800);
    assert_true(!plan.has_eye && !plan.has_look_at && !plan.has_limits);
    assert_ptr_equal(plan.given, &map_view_default);
    assert_true(map_view_default.point_px == 1.5 && map_view_default.shade == 1.0 && map_view_default.point_m < 0.0);
    assert_true(map_view_default.below_m == INFINITY && map_view_default.above_m == -INFINITY);
}

/* The eight winds are clockwise from north, 45 degrees apart. */
static void winds_and_degrees_are_azimuths(void **state)
{
    static const char *const winds[] = {"north", "north-east", "east", "south-east",
                                        "south", "south-west", "west", "north-west"};
    static const struct {
        const char *text;
        double deg;
    } degrees[] = {{"0", 0.0}, {"-90", -90.0}, {"360", 360.0}, {"-360", -360.0}, {"12.5", 12.5}};
    struct map_view_options o = map_view_default;
    (void)state;
    for (int i = 0; i < 8; i++) {
        o.from = winds[i];
        reads(&o);
        assert_true(fabs(plan.azimuth_rad - i * M_PI / 4.0) < 1e-12);
        assert_string_equal(map_view_winds[i], winds[i]);
    }
    for (size_t i = 0; i < sizeof degrees / sizeof degrees[0]; i++) {
        o.from = degrees[i].text;
        reads(&o);
        assert_true(fabs(plan.azimuth_rad - degrees[i].deg / 180.0 * M_PI) < 1e-12);
    }
}

static void colours_are_in_their_order(void **state)
{
    static const char *const names[] = {"height", "range", "reflectance", "label", "station", "rgb"};
    struct map_view_options o = map_view_default;
    (void)state;
    for (int i = 0; i < 6; i++) {
        o.colour = names[i];
        o.limits = i < 2 ? "-1,2.5" : NULL; /* only these two have limits */
        reads(&o);
        assert_int_equal(plan.colour, i);
        assert_int_equal(plan.has_limits, i < 2);
        if (i < 2) assert_true(plan.limit[0] == -1.0 && plan.limit[1] == 2.5);
    }
}

static void places_and_sizes_reach_their_bounds(void **state)
{
    struct map_view_options o = map_view_default;
    (void)state;
    o.eye = "1,-2.5,1e9";
    o.look_at = "-1e9,4,5";
    o.size = "16x8192";
    reads(&o);
    assert_true(plan.has_eye && plan.camera.eye_m[0] == 1.0 && plan.camera.eye_m[1] == -2.5);
    assert_true(plan.camera.eye_m[2] == 1e9 && plan.has_look_at && plan.camera.look_at_m[0] == -1e9);
    assert_true(plan.camera.look_at_m[1] == 4.0 && plan.camera.look_at_m[2] == 5.0);
    assert_true(plan.camera.width == 16 && plan.camera.height == 8192);
    o.size = "4096x4096";
    reads(&o);
    o.size = "4096x4097";
    assert_int_equal(map_view_read(&o, &plan, &err), SH_EINPUT);
    assert_string_equal(err.text, "--size 4096x4097: 16781312 pixels; allowed are 16777216 in all, as in 4096x4096");
    o.size = NULL;
    o.below_m = 1.0;
    o.above_m = 0.5;
    reads(&o);
}

/* A text that is refused leaves its own text in the error. */
static void what_is_wrong_is_named(void **state)
{
    static const char *const sizes[] = {"15x20", "20x15", "16x8193", "8193x16", "16", "16x16x16", "nanx16"};
    struct map_view_options o = map_view_default;
    (void)state;
    for (size_t i = 0; i < sizeof sizes / sizeof sizes[0]; i++) {
        char want[160];
        o.size = sizes[i];
        assert_int_equal(map_view_read(&o, &plan, &err), SH_EINPUT);
        snprintf(want, sizeof want, "--size %s: allowed are WIDTHxHEIGHT in pixels, 16 to 8192 each, as in 1200x800",
                 sizes[i]);
        assert_string_equal(err.text, want);
    }
    o = map_view_default;
    o.limits = "2,1";
    assert_int_equal(map_view_read(&o, &plan, &err), SH_EINPUT);
    assert_string_equal(err.text, "--limits 2,1: allowed are LOW,HIGH, the second larger than the first");
    o = map_view_default;
    o.below_m = 0.25;
    o.above_m = 0.5;
    assert_int_equal(map_view_read(&o, &plan, &err), SH_EINPUT);
    assert_string_equal(err.text, "--below 0.25: allowed is a height above that of --above, 0.5");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(without_options_there_are_defaults),
        cmocka_unit_test(winds_and_degrees_are_azimuths),
        cmocka_unit_test(colours_are_in_their_order),
        cmocka_unit_test(places_and_sizes_reach_their_bounds),
        cmocka_unit_test(what_is_wrong_is_named),
    };
    return cmocka_run_group_tests_name("map view options", tests, NULL, NULL);
}
