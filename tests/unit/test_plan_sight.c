/* SPDX-License-Identifier: MIT */
/* What a plan finds out by sampling pulses of the head. For a map of the directions: kinds of cells, in a view whose
 * left half is one triangle, whose lower right quarter is another, and whose upper right quarter is empty. For glass:
 * the share of pulses that need more depth, where the left half is a pane before a wall. */
#include <math.h>
#include <string.h>

#include "core/plan.h"
#include "core/sight.h"
#include "tests/common/made.h"

enum { DRAWN = 1024 };

static const double PAN_RAD = M_PI / 180.0, MIRROR_RAD = 2.0 * M_PI / 180.0;
static const struct beam_view VIEW = {-1.0, 1.0, -0.5, 0.5, 400, 400};

static struct scene *make_view(void)
{
    static const double corner[6][3] = {{0, 20, -100}, {0, 20, 100}, {-200, 20, 0},
                                        {0, 20, 0},    {100, 20, 0}, {0, 20, -100}};
    static const uint32_t triangle[2][3] = {{0, 1, 2}, {3, 4, 5}};
    return made_scene(&(struct scene_arrays){corner, 6, triangle, 2, NULL, NULL, 0});
}

static void sample(double cell_rad, double rays, struct plan_sight_found *found)
{
    struct beam_rig rig;
    struct plan_sample *sample;
    struct sh_err err;
    made_beam_rig(&rig, make_view(), &VIEW);
    struct plan_place place = {.setup = rig.setup, .segment = rig.segment, .pulses = VIEW.lines * VIEW.pulses};
    assert_int_equal(plan_sample_create(&(struct plan_places){&place, 1}, NULL, &sample, &err), SH_OK);
    plan_sample_sight(sample, cell_rad, rays, found);
    plan_sample_free(sample);
    beam_rig_close(&rig);
}

/* A share p of 1,024 pulses has a standard error of the root of p (1 - p) / 1024. Five of these are allowed; the draw
 * is always the same. */
static void near_share(double got, double p)
{
    if (!(fabs(got - p) <= 5.0 * sqrt(p * (1.0 - p) / DRAWN))) fail_msg("%g instead of %g", got, p);
}

/* A cell shows several surfaces if its square crosses an edge. Its distance from the middle or, on the right, from the
 * horizon is then below half its width. */
static void cells_of_each_kind(void **state)
{
    (void)state;
    static const double cells_rad[2] = {0.001, 0.004};
    struct plan_sight_found found;
    for (int k = 0; k < 2; k++) {
        const double middle = cells_rad[k] / PAN_RAD, horizon = cells_rad[k] / MIRROR_RAD;
        const double side = 0.5 * (1.0 - middle), quarter = side * 0.5 * (1.0 - horizon);
        sample(cells_rad[k], 1e12, &found);
        near_share(found.few, middle + side * horizon);
        near_share(found.one, side + quarter);
        near_share(found.nothing, quarter);
        assert_true(found.ask == 0.0 && found.small == 0.0);
        assert_true(fabs(found.few + found.one + found.nothing - 1.0) < 1e-12);
        /* The first face has 20,000 m2 at 20 m, the second 5,000: 3.979 and 0.995 times the sphere of 20 m. A pulse of
         * an empty place hits none. The shares scatter by 3 %. */
        const double whole_m2 = 4.0 * M_PI * 400.0, want = (0.5 * whole_m2 / 20000.0 + 0.25 * whole_m2 / 5000.0) / 1e12;
        assert_true(fabs(found.per_pulse - want) < 0.15 * want);
        assert_true(found.examined == 2.0);
    }
}

/* Where fewer than SIGHT_GROUP_RAYS rays come to a triangle, it is left to the BVH. */
static void triangles_that_are_too_small(void **state)
{
    (void)state;
    struct plan_sight_found found;
    const double least = SIGHT_GROUP_RAYS * 4.0 * M_PI * 400.0 / 20000.0; /* 64 rays to the first */
    sample(0.001, 0.9 * least, &found);
    near_share(found.small, 0.75);
    assert_true(found.one == 0.0 && found.per_pulse == 0.0);
    assert_true(found.nothing > 0.2 && found.nothing < 0.25);
    sample(0.001, 1.1 * least, &found); /* the second has a quarter of these */
    near_share(found.small, 0.25);
    assert_true(found.one > 0.4 && found.one < 0.5);
}

/* A long scan of this view pays for a map, a short one does not; where no map is possible, the row says why. */
static void a_plan_of_the_view(void **state)
{
    (void)state;
    struct beam_rig rig;
    struct plan_row row;
    struct sh_err err;
    int map = -1;
    made_beam_rig(&rig, make_view(), &VIEW);
    struct plan_place place = {.setup = rig.setup, .segment = rig.segment, .pulses = VIEW.lines * VIEW.pulses};
    const struct plan_places places = {&place, 1};
    struct plan_sight_need need = {
        .pulses = 1e9, .share = 0.01, .n_triangles = 2, .packet = 4, .memory_bytes = 1 << 28, .forced = -1};
    assert_int_equal(plan_sight(&need, &places, NULL, &map, &row, &err), SH_OK);
    assert_int_equal(map, 1);
    assert_string_equal(row.method, "map");
    need.pulses = 1000.0;
    assert_int_equal(plan_sight(&need, &places, NULL, &map, &row, &err), SH_OK);
    assert_int_equal(map, 0);
    assert_non_null(strstr(row.why, "are too few"));
    need.pulses = 1e9;
    need.why_not = "the head moves";
    assert_int_equal(plan_sight(&need, &places, NULL, &map, &row, &err), SH_OK);
    assert_int_equal(map, 0);
    assert_string_equal(row.why, "the head moves");
    beam_rig_close(&rig);
}

/* In the half of the pulses that meet the pane, a depth of 0 misses the wall behind it. A depth of 1 is right. When
 * none of 8,192 pulses is wrong, the limit is a mean of 2.996 wrong ones: such a mean gives one or more in 95 % of
 * draws (Poisson). The limit's formula is right to a hundredth. */
static void a_pane_before_a_wall(void **state)
{
    (void)state;
    enum { WAYS = 8192 };
    static const double corner[9][3] = {{0, 20, -100}, {0, 20, 100},     {-200, 20, 0},   {0, 20, 0},  {100, 20, 0},
                                        {0, 20, -100}, {-400, 30, -400}, {400, 30, -400}, {0, 30, 800}};
    static const uint32_t triangle[3][3] = {{0, 1, 2}, {3, 4, 5}, {6, 7, 8}};
    static const uint16_t label[3] = {0, 1, 2};
    static const struct scene_surface surface[3] = {{.object = "pane"}, {.object = "plate"}, {.object = "wall"}};
    struct surface of[4] = {{.reflectance = 0.5, .glass = 0.5}, {.reflectance = 0.5}, {.reflectance = 0.5}};
    const struct surface_table table = {.n = 3, .surface = of, .has_optics = 1};
    const struct cast_detect detect = {.surfaces = &table, .depth = 1, .max_echoes = 4};
    struct beam_rig rig;
    struct plan_sample *sample;
    struct plan_option option;
    struct sh_err err;
    made_beam_rig(&rig, made_scene(&(struct scene_arrays){corner, 9, triangle, 3, label, surface, 3}), &VIEW);
    struct plan_place place = {.setup = rig.setup, .segment = rig.segment, .pulses = VIEW.lines * VIEW.pulses};
    place.setup.detect = &detect;
    assert_int_equal(plan_sample_create(&(struct plan_places){&place, 1}, NULL, &sample, &err), SH_OK);
    plan_sample_optics(sample, 0, &option);
    const double scatter = sqrt(0.25 / WAYS), limit = 0.5 + 1.645 * scatter;
    assert_true(fabs(option.echo_share - limit) < 5.0 * scatter && option.cost_ns == 0.0);
    plan_sample_optics(sample, 1, &option);
    assert_true(fabs(option.echo_share - 2.996 / WAYS) < 0.01 * 2.996 / WAYS);
    assert_true(option.error_m == 0.0);
    /* Each of these pulses has a second echo beyond the pane, and a ray there costs 70 ns (core/plan/cost.h). */
    assert_true(fabs(option.cost_ns / 70.0 - 0.5) < 5.0 * scatter);
    plan_sample_free(sample);
    beam_rig_close(&rig);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(cells_of_each_kind),
        cmocka_unit_test(triangles_that_are_too_small),
        cmocka_unit_test(a_plan_of_the_view),
        cmocka_unit_test(a_pane_before_a_wall),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
