/* SPDX-License-Identifier: MIT */
/* How far points may be from a station's place or from the middle of a stretch of a path, which decides the error of
 * the georeference. Also the worst stretch of a path, and the warnings. */
#include "tests/unit/site_rig.h"

#include <math.h>

#include "core/georef.h"

/* The floor and a mast give the box x -50 to 20, y -10 to 60, z -3 to 9. */
static const char ROOM[] = "v -50 -10 -3\nv 20 -10 -3\nv 20 60 -3\nv -50 60 -3\nv -50 60 9\nf 1 2 3 4\nf 3 4 5\n";

static struct site *load(const char *mesh, const char *station, const char *more)
{
    struct site *site = NULL;
    char text[1024];
    write_in("room.obj", ROOM);
    write_in("box.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
    snprintf(text, sizeof text,
             "head: {profile: full-sweep}\nscene:\n  meshes:\n    - {file: room.obj, up: z, scale: 1}\n%s"
             "stations: [{name: one, %s}]\nnoise: {range: off}\n%s",
             mesh, station, more);
    write_in("test.yaml", text);
    clear_warned();
    int rc = config_load(config_path, NULL, 0, cfg, &err);
    if (rc == SH_OK) rc = site_load(cfg, &report, &site, &err);
    if (rc != SH_OK) fail_msg("%s", err.text);
    return site;
}

#define AT_48        ", lat_deg: 48, lon_deg: 11, height_m: 500"
#define OUTPUT(more) "output: {crs: geodetic, layout: geo, heights: ellipsoid" more "}\n"
#define ORDER1       OUTPUT(", georef: order1")
#define MOVER        "    - {file: box.obj, up: z, scale: 1, move_m_s: [0, 1, 0]}\n"

/* The margin is a hundredth, and ten times the head's 3 mm of noise. */
static double within(double far_m)
{
    return 1.01 * far_m + 0.03;
}

/* Points are in the scene's box and within the range of 1000 m. Where noise or a live head takes them further, that
 * counts. Where they may leave the box, only the range counts. */
static void extents(void **state)
{
    (void)state;
    const struct {
        const char *mesh, *station, *more;
        double radius_m, height_m;
    } is[] = {
        /* 55 and 53 m to the farther sides, 7 m up */
        {"", "position_m: [5, 7, 2]" AT_48, ORDER1, hypot(within(55), within(53)), within(7)},
        {"", "position_m: [-30, 40, 8]" AT_48, ORDER1, hypot(within(50), within(50)), within(11)},
        {"", "position_m: [3000, 7, 2]" AT_48, ORDER1, 1010, within(7)},
        {"", "position_m: [5, 7, 2]" AT_48, ORDER1 "platform: {kind: live, reach_m: 30}\n",
         hypot(within(55), within(53)), within(7)},
        {"", "position_m: [3000, 7, 2]" AT_48, ORDER1 "platform: {kind: live, reach_m: 30}\n", 1.01 * 1030, within(7)},
        {"", "position_m: [3000, 7, 2000]" AT_48, ORDER1, 1010, 1010},
        {"", "position_m: [5, 7, 2]" AT_48, ORDER1 "instrument: {range_offset_m: 0.1}\n", 1010, 1010},
        {MOVER, "position_m: [5, 7, 2]" AT_48, ORDER1, 1010, 1010},
    };
    for (size_t i = 0; i < sizeof is / sizeof is[0]; i++) {
        char says[160];
        struct site *site = load(is[i].mesh, is[i].station, is[i].more);
        const struct site_station *s = &site->station[0];
        const double want_m = georef_bound_m(s->georef, GEOREF_ORDER1, is[i].radius_m, is[i].height_m);
        if (!(fabs(s->plan.error_m - want_m) < 1e-12 * want_m))
            fail_msg("%zu: %.12g m instead of %.12g m; %s", i, s->plan.error_m, want_m, s->plan.why);
        snprintf(says, sizeof says,
                 "station one: the error of georeferencing by order1 may be %.2g m, more than the 1e-06 m of "
                 "output.tolerance_m\n",
                 want_m);
        assert_non_null(strstr(warned, says));
        assert_null(strstr(warned, "longitude"));
        site_free(site);
    }
}

/* ---- paths */

static struct site *travel(double from_m, double to_m, const char *station, const char *output)
{
    char path[128], more[256];
    snprintf(path, sizeof path, "t_s,x_m,y_m,z_m,heading_deg\n0,%g,0,2,0\n300,%g,0,2,0\n", from_m, to_m);
    write_in("path.csv", path);
    snprintf(more, sizeof more, "%splatform: {kind: trajectory, file: path.csv}\n", output);
    return load("", station, more);
}

static double bound_of(const struct site *site, size_t i, enum georef_method method)
{
    const struct site_stretch *stretch = &site->stretch[i];
    const double reach_m = 1.01 * (1000 + stretch->reach_m), x_m = stretch->centre_m[0];
    const double radius_m = hypot(within(fmax(x_m + 50, 20 - x_m)), within(60));
    return georef_bound_m(site->station[0].on_stretch[i].georef, method, fmin(reach_m, radius_m), within(7));
}

/* The stretch with the largest error is the path's, whether it comes first or last. The short stretch lies beside the
 * scene; the long one is too far away to see all of it. */
static void the_worst_stretch_counts(void **state)
{
    (void)state;
    for (int back = 0; back < 2; back++) {
        struct site *site = travel(back ? 4000 : 1000, back ? 1000 : 4000, "position_m: [5, 7, 2]" AT_48, ORDER1);
        const struct plan_row *plan = &site->station[0].plan;
        assert_int_equal(site->n_stretches, 2);
        const double first_m = bound_of(site, 0, GEOREF_ORDER1), last_m = bound_of(site, 1, GEOREF_ORDER1);
        assert_true(fabs(plan->error_m - fmax(first_m, last_m)) < 1e-12);
        assert_non_null(strstr(plan->why, "path of 2 stretches, each about its middle: asked for by output.georef: "));
        assert_null(strstr(warned, "longitude"));
        site_free(site);
    }
}

/* The tolerance lies between the errors of the two stretches, so that one needs a polynomial of second order. The
 * path has the polynomial of the higher order, though its error is the smaller one. */
static void the_costliest_stretch_counts(void **state)
{
    (void)state;
    for (int back = 0; back < 2; back++) {
        struct site *site =
            travel(back ? 4000 : 1000, back ? 1000 : 4000, "position_m: [5, 7, 2]" AT_48, OUTPUT(", tolerance_m: 0.6"));
        const struct site_station *s = &site->station[0];
        const double errors_m[2] = {bound_of(site, 0, GEOREF_ORDER1), bound_of(site, 1, GEOREF_ORDER1)};
        const size_t far = errors_m[1] > errors_m[0];
        assert_true(errors_m[far] > 0.6 && errors_m[!far] < 0.6);
        assert_int_equal(georef_method(s->on_stretch[far].georef), GEOREF_ORDER2);
        assert_int_equal(georef_method(s->on_stretch[!far].georef), GEOREF_ORDER1);
        assert_string_equal(s->plan.method, "order2");
        assert_true(fabs(s->plan.error_m - bound_of(site, far, GEOREF_ORDER2)) < 1e-12);
        assert_null(strstr(warned, "tolerance"));
        site_free(site);
    }
}

/* ---- counts of longitude near a pole: half a turn on the outermost circle has 2^31 counts */

static void expect_count(double circle_m)
{
    char says[192];
    snprintf(says, sizeof says,
             "station one: a count of longitude is up to %.2g m, all others at most 1e-06 m: near a pole 360 degrees "
             "must fit into 31 bits\n",
             M_PI * circle_m / 0x1p31);
    if (strstr(warned, says) == NULL) fail_msg("%s instead of %s", warned, says);
}

static void counts_at_a_pole(void **state)
{
    (void)state;
    static const char at_pole[] = "position_m: [0, 0, 2], lat_deg: 90, lon_deg: 0, height_m: 0";
    struct site *site = load("", at_pole, OUTPUT(""));
    expect_count(1000);
    site_free(site);
    site = load("", at_pole, OUTPUT("") "platform: {kind: live, reach_m: 700}\n");
    expect_count(1700);
    site_free(site);
    /* The middle is 500 m away from the pole, and the poses 501 m from it. */
    site = travel(0, 1000, at_pole, OUTPUT(""));
    expect_count(500 + 501 + 1000);
    site_free(site);
    /* The other stretch, 2500 m away or more, does not reach the pole. */
    for (int back = 0; back < 2; back++) {
        site = travel(back ? 3500 : 0, back ? 0 : 3500, at_pole, OUTPUT(""));
        expect_count(back ? 750 + 751 + 1000 : 1000 + 1001 + 1000);
        site_free(site);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(extents),
        cmocka_unit_test(the_worst_stretch_counts),
        cmocka_unit_test(the_costliest_stretch_counts),
        cmocka_unit_test(counts_at_a_pole),
    };
    return cmocka_run_group_tests_name("georeference", tests, site_rig_setup, site_rig_teardown);
}
