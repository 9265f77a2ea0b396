/* SPDX-License-Identifier: MIT */
/* A head's attitude, by vectors known by hand, and the floor below it. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>
#include <cmocka.h>

#include "core/cast.h"
#include "core/mat3.h"

#define RAD(deg) ((deg)*M_PI / 180.0)

static struct sh_err err;

static void assert_vector(const double got[3], double x, double y, double z)
{
    const double want[3] = {x, y, z};
    for (int i = 0; i < 3; i++)
        if (!(fabs(got[i] - want[i]) <= 1e-15)) /* sines to an ulp, one product or two */
            fail_msg("%.17g %.17g %.17g instead of %g %g %g", got[0], got[1], got[2], x, y, z);
}

static void turned(double heading_deg, double pitch_deg, double roll_deg, const double p_socs[3], double p[3])
{
    double r[9];
    pose_attitude(RAD(heading_deg), RAD(pitch_deg), RAD(roll_deg), r);
    mat3_apply(r, p_socs, p);
}

/* Right, forward and up of the head are checked after each turn alone, and after all three by 90 degrees in their
 * order. */
static void attitudes_by_hand(void **state)
{
    (void)state;
    static const double right[3] = {1, 0, 0}, forward[3] = {0, 1, 0}, up[3] = {0, 0, 1};
    const double h = sqrt(0.5);
    double p[3];
    turned(90, 0, 0, forward, p); /* clockwise: to the east */
    assert_vector(p, 1, 0, 0);
    turned(90, 0, 0, right, p);
    assert_vector(p, 0, -1, 0);
    turned(0, 45, 0, forward, p); /* nose up */
    assert_vector(p, 0, h, h);
    turned(0, 45, 0, up, p);
    assert_vector(p, 0, -h, h);
    turned(0, 0, 45, right, p); /* right side down */
    assert_vector(p, h, 0, -h);
    turned(0, 0, 45, up, p);
    assert_vector(p, h, 0, h);
    /* The head faces east, its nose to the zenith, then rolled about that vertical. The right side, south before, sinks
     * in the head's sense of down, which is east. */
    turned(90, 90, 90, forward, p);
    assert_vector(p, 0, 0, 1);
    turned(90, 90, 90, right, p);
    assert_vector(p, 1, 0, 0);
    turned(90, 90, 90, up, p);
    assert_vector(p, 0, -1, 0);
}

/* The attitude is the product of the three turns, as the header defines it. */
static void attitude_is_the_product(void **state)
{
    (void)state;
    const double h = 0.7, p = -0.3, r = 1.1;
    const double about_z[9] = {cos(h), sin(h), 0, -sin(h), cos(h), 0, 0, 0, 1};
    const double about_x[9] = {1, 0, 0, 0, cos(p), -sin(p), 0, sin(p), cos(p)};
    const double about_y[9] = {cos(r), 0, sin(r), 0, 1, 0, -sin(r), 0, cos(r)};
    double zx[9], want[9], got[9];
    mat3_multiply(about_z, about_x, zx);
    mat3_multiply(zx, about_y, want);
    pose_attitude(h, p, r, got);
    for (int i = 0; i < 9; i++)
        assert_true(fabs(got[i] - want[i]) < 1e-15);
    pose_heading(h, got);
    assert_memory_equal(got, about_z, sizeof got);
}

/* The scene has a floor at z = 0 of 10 x 10 m with a hole at 4..6, and a cellar at -3. A table stands at 0.75 over
 * 1..2, and a wall at x = 8. */
static const double at_z[][5] = {
    /* x0 x1 y0 y1 z */
    {0, 4, 0, 10, 0}, {6, 10, 0, 10, 0}, {4, 6, 0, 4, 0}, {4, 6, 6, 10, 0}, {0, 10, 0, 10, -3}, {1, 2, 1, 2, 0.75},
};
enum { PLATES = sizeof at_z / sizeof at_z[0] };

static struct scene *make_house(const double shift_m[3])
{
    double v[4 * PLATES + 4][3];
    uint32_t t[2 * PLATES + 2][3];
    struct scene *scene = NULL;
    for (uint32_t i = 0; i < PLATES; i++) {
        const double *q = at_z[i];
        for (uint32_t k = 0; k < 4; k++) {
            const double corner[3] = {k == 1 || k == 2 ? q[1] : q[0], k > 1 ? q[3] : q[2], q[4]};
            memcpy(v[4 * i + k], corner, sizeof corner);
        }
    }
    const double wall[4][3] = {{8, 0, 0}, {8, 10, 0}, {8, 10, 3}, {8, 0, 3}};
    memcpy(v[4 * PLATES], wall, sizeof wall);
    for (uint32_t i = 0; i <= PLATES; i++)
        for (uint32_t k = 0; k < 2; k++) {
            const uint32_t corners[3] = {4 * i, 4 * i + 1 + k, 4 * i + 2 + k};
            memcpy(t[2 * i + k], corners, sizeof corners);
        }
    for (int i = 0; i < 4 * PLATES + 4; i++)
        for (int k = 0; k < 3; k++)
            v[i][k] += shift_m[k];
    if (scene_from_arrays(&(struct scene_arrays){(const double(*)[3])v, 4 * PLATES + 4, (const uint32_t(*)[3])t,
                                                 2 * PLATES + 2, NULL, NULL, 0},
                          &scene, &err) != SH_OK)
        fail_msg("%s", err.text);
    return scene;
}

static double first_along(const struct scene *scene, const double from[3], const double dir[3])
{
    struct bvh *bvh;
    if (bvh_create(scene, 1, NULL, &bvh, &err) != SH_OK) fail_msg("%s", err.text);
    const double range_m = bvh_ray(bvh, from, dir);
    bvh_free(bvh);
    return range_m;
}

static void assert_floor(const struct scene *scene, const double shift_m[3], double x, double y, double z,
                         double range_m)
{
    const double from[3] = {x + shift_m[0], y + shift_m[1], z + shift_m[2]}, down[3] = {0, 0, -1};
    const double got_m = first_along(scene, from, down);
    if (isnan(range_m) && isnan(got_m)) return;
    /* the place is rounded at 6e6 m: 1e-9 */
    if (!(fabs(got_m - range_m) <= 2e-9)) fail_msg("%g %g %g: %.12g instead of %.12g", x, y, z, got_m, range_m);
}

static void the_floor_is_the_next_one_below(void **state)
{
    (void)state;
    static const double shift_m[][3] = {{0, 0, 0}, {391000, 5819000, 111}};
    for (int k = 0; k < 2; k++) {
        struct scene *scene = make_house(shift_m[k]);
        const double *s = shift_m[k];
        assert_floor(scene, s, 3, 7, 1.5, 1.5);
        assert_floor(scene, s, 5, 5, 1.5, 4.5);      /* through the hole */
        assert_floor(scene, s, 1.5, 1.4, 1.5, 0.75); /* on the table */
        assert_floor(scene, s, 1.5, 1.4, 0.5, 0.5);  /* below it */
        assert_floor(scene, s, 3, 7, -1, 2);         /* in the cellar */
        assert_floor(scene, s, 3, 7, -4, NAN);       /* below everything */
        assert_floor(scene, s, 11, 5, 1, NAN);       /* beside it */
        assert_floor(scene, s, 4, 2, 1, 1);          /* on the edge of two plates, and of the triangles of another */
        assert_floor(scene, s, 2, 5, 1, 1);
        assert_floor(scene, s, 8.25, 5, 2, 2); /* beside the wall, which is vertical */
        scene_free(scene);
    }
}

/* Down need not be -z. */
static void down_is_any_direction(void **state)
{
    (void)state;
    static const double none[3] = {0, 0, 0};
    struct scene *scene = make_house(none);
    const double from[3] = {5, 2, 1}, down[3] = {0.6, 0, -0.8}, sideways[3] = {1, 0, 0};
    assert_true(fabs(first_along(scene, from, down) - 1.25) < 1e-14);
    assert_true(fabs(first_along(scene, from, sideways) - 3) < 1e-14); /* the wall */
    scene_free(scene);
}

/* Two floors are 0.1 um apart, and seen from 40 m. Whichever float would take, the upper one counts. */
static void floors_are_ordered_exactly(void **state)
{
    (void)state;
    static const double gap_m = 1e-7, down[3] = {0, 0, -1};
    for (int upper = 0; upper < 2; upper++) {
        double v[6][3];
        static const double corner[3][2] = {{-9, -7}, {11, -5}, {1, 13}};
        static const uint32_t t[2][3] = {{0, 1, 2}, {3, 4, 5}};
        for (int i = 0; i < 6; i++) {
            const double p[3] = {corner[i % 3][0], corner[i % 3][1], i / 3 == upper ? 3 + gap_m : 3};
            memcpy(v[i], p, sizeof p);
        }
        struct scene *scene = NULL;
        assert_int_equal(
            scene_from_arrays(&(struct scene_arrays){(const double(*)[3])v, 6, t, 2, NULL, NULL, 0}, &scene, &err),
            SH_OK);
        for (int i = 0; i < 50; i++) {
            const double from[3] = {0.1 * i - 2, 0.07 * i - 2, 43};
            assert_true(fabs(first_along(scene, from, down) - (40 - gap_m)) < 1e-12);
        }
        scene_free(scene);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(attitudes_by_hand),
        cmocka_unit_test(attitude_is_the_product),
        cmocka_unit_test(the_floor_is_the_next_one_below),
        cmocka_unit_test(floors_are_ordered_exactly),
        cmocka_unit_test(down_is_any_direction),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
