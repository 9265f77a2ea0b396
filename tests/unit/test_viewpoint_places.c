/* SPDX-License-Identifier: MIT */
/* Places for a tripod (core/studio/viewpoint.h): each of their limits from both sides, their grid and their order. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/angle.h"
#include "core/studio/viewpoint.h"
#include "tests/common/made.h"

enum { MOST = 64 };

static double vertex_m[4 * MOST][3];
static uint32_t triangle[2 * MOST][3];
static uint32_t n_quads;
static struct viewpoint_place *place;
static uint32_t n_places;

/* Corners in turn. */
static void add_quad(const double corner[4][3])
{
    const uint32_t v = 4 * n_quads;
    memcpy(vertex_m[v], corner, 4 * sizeof *vertex_m);
    memcpy(triangle[2 * n_quads], (const uint32_t[3]){v, v + 1, v + 2}, sizeof *triangle);
    memcpy(triangle[2 * n_quads + 1], (const uint32_t[3]){v, v + 2, v + 3}, sizeof *triangle);
    n_quads++;
}

static void add_rectangle(double x0_m, double y0_m, double x1_m, double y1_m, double z_m)
{
    add_quad((const double[4][3]){{x0_m, y0_m, z_m}, {x1_m, y0_m, z_m}, {x1_m, y1_m, z_m}, {x0_m, y1_m, z_m}});
}

/* A level rectangle around the middle. */
static void add_level(double x_m, double y_m, double z_m)
{
    add_rectangle(-x_m, -y_m, x_m, y_m, z_m);
}

/* Rays that are cast give lengths with an error of some 1e-16. */
static int is_near(double got, double want)
{
    return fabs(got - want) < 1e-12;
}

static int find_all(const struct viewpoint_grid *grid, const struct sh_report *report)
{
    struct sh_err err;
    const struct scene_arrays arrays = {
        (const double(*)[3])vertex_m, 4 * n_quads, (const uint32_t(*)[3])triangle, 2 * n_quads, NULL, NULL, 0};
    struct scene *scene = made_scene(&arrays);
    struct bvh *bvh = made_bvh(scene);
    free(place);
    const int rc = viewpoint_places(bvh, grid, report, &place, &n_places, &err);
    bvh_free(bvh);
    scene_free(scene);
    return rc;
}

/* Looks at one place, in the middle, with a head 1.5 m above the floor. */
static uint32_t count_in_middle(void)
{
    const struct viewpoint_grid grid = {1.0, 1.5, {-0.5, -0.5, -5}, {0.5, 0.5, 5}};
    assert_int_equal(find_all(&grid, NULL), SH_OK);
    n_quads = 0;
    return n_places;
}

/* 20 degrees are allowed; at 0.3 m the surface is then 0.11 m higher. */
static void a_floor_is_not_steep(void **state)
{
    (void)state;
    for (int steep = 0; steep < 2; steep++)
        for (int turned = 0; turned < 2; turned++) {
            const double h = 2 * tan(angle_rad(steep ? 20.1 : 19.9));
            const double corner[4][3] = {{-2, -2, -h}, {2, -2, turned ? -h : h}, {2, 2, h}, {-2, 2, turned ? h : -h}};
            add_quad(corner);
            assert_int_equal(count_in_middle(), !steep);
        }
}

/* A head on the floor, or just above it, stands where a higher one does: on floors that go up or down by 0.15 m, and
 * not beside a wall. */
static void low_heads_stand_too(void **state)
{
    (void)state;
    static const double height_m[] = {0, 0.001, 0.1, 0.159, 0.161, 1.5};
    for (size_t i = 0; i < sizeof height_m / sizeof height_m[0]; i++) {
        const struct viewpoint_grid grid = {1.0, height_m[i], {-0.5, -0.5, -5}, {0.5, 0.5, 5}};
        for (int row = 0; row < 4; row++) {
            const double steep = row == 1 ? 19.9 : row == 2 ? 20.1 : 0, h = 2 * tan(angle_rad(steep));
            add_quad((const double[4][3]){{-2, -2, -h}, {2, -2, h}, {2, 2, h}, {-2, 2, -h}});
            if (row == 3) add_quad((const double[4][3]){{0.2, -2, 0}, {0.2, 2, 0}, {0.2, 2, 3}, {0.2, -2, 3}});
            assert_int_equal(find_all(&grid, NULL), SH_OK);
            n_quads = 0;
            assert_int_equal(n_places, row < 2);
            if (n_places == 1) assert_true(fabs(place[0].position_m[2] - height_m[i]) < 5.01e-4);
        }
    }
}

/* At least 0.2 m above the head are free. A floor's lower side counts as a ceiling. */
static void there_is_room_above(void **state)
{
    (void)state;
    add_level(2, 2, 0);
    add_level(2, 2, 1.701);
    assert_int_equal(count_in_middle(), 2); /* the ceiling has the sky above it */
    assert_true(is_near(place[0].floor_m, 1.701) && is_near(place[1].floor_m, 0));
    add_level(2, 2, 0);
    add_level(2, 2, 1.699);
    assert_int_equal(count_in_middle(), 1);
    assert_true(is_near(place[0].floor_m, 1.699) && is_near(place[0].position_m[2], 3.199));
}

/* A strip 0.25 m wide on either side leaves out two of the eight legs at 0.3 m, which is allowed. A strip that ends 0.1
 * m to the side leaves out three. */
static void most_legs_stand(void **state)
{
    (void)state;
    add_level(2, 0.25, 0);
    assert_int_equal(count_in_middle(), 1);
    add_level(0.25, 2, 0);
    assert_int_equal(count_in_middle(), 1);
    add_level(2, 0.2, 0);
    assert_int_equal(count_in_middle(), 0);
    for (int side = 0; side < 4; side++) {
        add_rectangle(side == 0 ? -0.1 : -2, side == 1 ? -0.1 : -2, side == 2 ? 0.1 : 2, side == 3 ? 0.1 : 2, 0);
        assert_int_equal(count_in_middle(), 0);
    }
    add_level(0.301, 0.301, 0);
    assert_int_equal(count_in_middle(), 1); /* all around at a distance of 0.3 m */
    add_level(0.299, 0.299, 0);
    assert_int_equal(count_in_middle(), 0);
}

/* Around a pedestal the ground may be 0.15 m lower or higher. */
static void legs_stand_level(void **state)
{
    (void)state;
    static const double around[4][4] = {{0.2, -2, 2, 2}, {-2, -2, -0.2, 2}, {-0.2, 0.2, 0.2, 2}, {-0.2, -2, 0.2, -0.2}};
    for (int sign = -1; sign <= 1; sign += 2)
        for (int beyond = 0; beyond < 2; beyond++) {
            const double z_m = sign * (beyond ? 0.151 : 0.149);
            add_level(0.2, 0.2, 0);
            for (int k = 0; k < 4; k++)
                add_rectangle(around[k][0], around[k][1], around[k][2], around[k][3], z_m);
            assert_int_equal(count_in_middle(), !beyond);
        }
}

/* At the head's height nothing is nearer than 0.3 m in any of the eight directions. */
static void the_head_is_free(void **state)
{
    (void)state;
    for (int i = 0; i < 8; i++)
        for (int near = 0; near < 2; near++) {
            const double turn = i * M_PI / 4, s = sin(turn), c = cos(turn), far_m = near ? 0.299 : 0.301, wide_m = 0.05;
            const double x = far_m * s, y = far_m * c, across[2] = {wide_m * c, -wide_m * s};
            add_level(2, 2, 0);
            add_quad((const double[4][3]){{x - across[0], y - across[1], 1.4},
                                          {x + across[0], y + across[1], 1.4},
                                          {x + across[0], y + across[1], 1.6},
                                          {x - across[0], y - across[1], 1.6}});
            assert_int_equal(count_in_middle(), !near);
        }
}

/* Floors count between the area's heights, ends included. */
static void floors_lie_within_the_area(void **state)
{
    (void)state;
    static const struct {
        double low_m, high_m;
        uint32_t n;
    } rows[] = {{0, 4, 2}, {0.001, 4, 1}, {0, 3.999, 1}, {0.001, 3.999, 0}, {4, 9, 1}, {-9, 0, 1}};
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        const struct viewpoint_grid grid = {1.0, 1.5, {-0.5, -0.5, rows[i].low_m}, {0.5, 0.5, rows[i].high_m}};
        add_level(2, 2, 0);
        add_level(2, 2, 4);
        assert_int_equal(find_all(&grid, NULL), SH_OK);
        assert_int_equal(n_places, rows[i].n);
        n_quads = 0;
    }
}

/* A floor that a ray finds is wrong by its rounding. So limits at the floor's own height, and a room as high as the head
 * needs, keep the floor under ceilings of many heights. Heights in whole millimetres are 1 mm apart, and limits are
 * good to half of that. */
static void limits_allow_for_rounding(void **state)
{
    (void)state;
    static const double floor_m[] = {0, 0.1, -0.05, 0.3, 1.37, 100.3, -7.77};
    for (size_t i = 0; i < sizeof floor_m / sizeof floor_m[0]; i++)
        for (int k = 0; k < 40; k++) {
            const double z_m = floor_m[i], height_m = 1.1 + 0.037 * k;
            const struct viewpoint_grid grid = {1.0, height_m, {-0.5, -0.5, z_m}, {0.5, 0.5, z_m}};
            add_level(2, 2, z_m);
            add_level(2, 2, z_m + height_m + 0.2);
            assert_int_equal(find_all(&grid, NULL), SH_OK);
            if (n_places != 1) fail_msg("floor at %g m, head %g m above it: %u places", z_m, height_m, n_places);
            assert_true(is_near(place[0].floor_m, z_m));
            n_quads = 0;
        }
}

/* A side that is a whole number of steps in decimal digits has a place for each: 0.6 / 0.2 and 3.3 / 1.1 are just below
 * 3 in binary ones. */
static void whole_steps_count(void **state)
{
    (void)state;
    static const double side_m[][2] = {{0.6, 0.2}, {3.3, 1.1}, {0.3, 0.1}, {8, 0.1}, {2.4, 0.8}};
    static const uint32_t along[] = {3, 3, 3, 80, 3};
    for (size_t i = 0; i < sizeof along / sizeof along[0]; i++) {
        const struct viewpoint_grid grid = {side_m[i][1], 1.2, {0, 0, -9}, {side_m[i][0], 1e-3, 9}};
        add_level(9, 9, 0);
        assert_int_equal(find_all(&grid, NULL), SH_OK);
        if (n_places != along[i]) fail_msg("%g m in steps of %g m: %u", side_m[i][0], side_m[i][1], n_places);
        n_quads = 0;
    }
}

/* A grid lies in the middle of its area, and has as many steps as it holds. Places are rounded to millimetres, floors
 * are not. They come by x, then y, then from above. */
static void the_grid_is_in_order(void **state)
{
    (void)state;
    static const double x_m[] = {0.35, 1.05, 1.75}, y_m[] = {-0.35, 0.35}, floor_m[] = {2.00049, 0.00049};
    const struct viewpoint_grid grid = {0.7004, 1.2, {0, -1, -9}, {2.1, 1, 9}};
    add_level(9, 9, 0.00049);
    add_level(9, 9, 2.00049);
    assert_int_equal(find_all(&grid, NULL), SH_OK);
    assert_int_equal(n_places, 8); /* 2 by 2, since three steps are 2.1012 m; one of 0.3502 m is on either side */
    for (uint32_t i = 0; i < 8; i++) {
        const double *p = place[i].position_m;
        assert_true(is_near(p[0], i / 4 == 0 ? 0.7 : 1.4));
        assert_true(is_near(p[1], i / 2 % 2 == 0 ? -0.35 : 0.35));
        assert_true(is_near(p[2], i % 2 == 0 ? 3.2 : 1.2) && is_near(place[i].floor_m, floor_m[i % 2]));
    }
    const struct viewpoint_grid even = {0.7, 1.2, {0, -0.75, -9}, {2.1 + 1e-9, 0.75, 1}};
    assert_int_equal(find_all(&even, NULL), SH_OK);
    assert_int_equal(n_places, 6);
    for (uint32_t i = 0; i < 6; i++) {
        assert_true(is_near(place[i].position_m[0], x_m[i / 2]) && is_near(place[i].position_m[1], y_m[i % 2]));
        assert_true(is_near(place[i].floor_m, 0.00049));
    }
    n_quads = 0;
}

static int n_asked, stop_at;

static int stop(void *ctx)
{
    (void)ctx;
    return n_asked++ >= stop_at;
}

/* Wherever the search is stopped, it has no places. */
static void the_search_can_be_stopped(void **state)
{
    (void)state;
    static const struct sh_report report = {.stop = stop};
    const struct viewpoint_grid grid = {1.0, 1.5, {-0.5, -0.5, -5}, {0.5, 0.5, 5}};
    for (stop_at = 0;; stop_at++) {
        n_asked = 0;
        n_quads = 0;
        add_level(2, 2, 0);
        if (find_all(&grid, &report) == SH_OK) break;
        assert_true(place == NULL && n_places == 0);
        assert_true(stop_at < 100);
    }
    assert_true(stop_at > 3 && n_places == 1);
    n_quads = 0;
}

static int free_places(void **state)
{
    (void)state;
    free(place);
    return 0;
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_floor_is_not_steep),       cmocka_unit_test(low_heads_stand_too),
        cmocka_unit_test(there_is_room_above),        cmocka_unit_test(most_legs_stand),
        cmocka_unit_test(legs_stand_level),           cmocka_unit_test(the_head_is_free),
        cmocka_unit_test(floors_lie_within_the_area), cmocka_unit_test(limits_allow_for_rounding),
        cmocka_unit_test(whole_steps_count),          cmocka_unit_test(the_grid_is_in_order),
        cmocka_unit_test(the_search_can_be_stopped),
    };
    return cmocka_run_group_tests(tests, NULL, free_places);
}
