/* SPDX-License-Identifier: MIT */
/* The choice among several options, and the plan's row about it. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "core/plan.h"
#include "core/plan/cost.h"
#include "core/sight.h"
#include "tests/common/cases.h"

static const struct plan_tolerance TOLERANCE = {1e-3, 1e-2};

enum { N = 4 };
static const struct plan_option options[N] = {{"a", 2e-3, 0.0, 1.0, "", BEAM_SINGLE, 0},
                                              {"b", 1e-3, 2e-2, 2.0, "", BEAM_SINGLE, 0},
                                              {"c", 1e-4, 1e-3, 9.0, "", BEAM_SINGLE, 0},
                                              {"d", 1e-4, 1e-2, 5.0, "", BEAM_SINGLE, 0}};

static void expect(const struct plan_row *row, const char *method, int forced, const char *why)
{
    assert_string_equal(row->method, method);
    assert_int_equal(row->forced, forced);
    if (strstr(row->why, why) == NULL) fail_msg("%s", row->why);
}

static void expect_left(const struct plan_row *row, uint32_t i, const char *method, const char *why)
{
    assert_true(i < row->n_left);
    assert_string_equal(row->left[i].method, method);
    if (strstr(row->left[i].why_not, why) == NULL) fail_msg("%s: %s", method, row->left[i].why_not);
}

static uint32_t choose(struct plan_row *row, const char *stage, const struct plan_option *option, uint32_t n,
                       int forced, const char *key)
{
    return plan_choose(&(struct plan_choice){stage, option, n, forced, key, TOLERANCE}, row);
}

/* The cheapest of those whose bounds hold is chosen, in any order. A bound that equals the tolerance holds. */
static void test_cheapest_that_holds(void **state)
{
    (void)state;
    struct plan_row row;
    assert_int_equal(choose(&row, "beam", options, N, -1, ""), 3);
    expect(&row, "d", 0, "the cheapest; holds 0.001 m, and 1 % of the pulses");
    assert_string_equal(row.stage, "beam");
    assert_true(row.error_m == 1e-4 && row.echo_share == 1e-2 && row.cost_ns == 5.0);
    assert_int_equal(row.n_left, 3);
    expect_left(&row, 0, "a", "its range error is above 0.001 m");
    expect_left(&row, 1, "b", "more than 1 % of the pulses get another echo count");
    expect_left(&row, 2, "c", "costs more");
}

static void test_forced(void **state)
{
    (void)state;
    struct plan_row row;
    assert_int_equal(choose(&row, "beam", options, N, 1, "beam.mode"), 1);
    expect(&row, "b", 1, "forced by beam.mode; does not hold");
    assert_int_equal(choose(&row, "beam", options, N, 2, "beam.mode"), 2);
    expect(&row, "c", 1, "forced by beam.mode; holds");
    expect_left(&row, 2, "d", "not asked for");
    assert_int_equal(choose(&row, "beam", options, N, 0, "beam.mode"), 0); /* the first can be forced, too */
    expect(&row, "a", 1, "forced by beam.mode; does not hold");
}

/* The options are compared by the ratio of error and tolerance: a has 2 and b 3, so a is chosen, however good b's
 * ranges are. */
static void test_least_off(void **state)
{
    (void)state;
    struct plan_row row;
    struct plan_option some[3] = {options[1], options[0], {"e", (double)NAN, (double)NAN, 0.1, "", BEAM_SINGLE, 0}};
    some[0].echo_share = 3e-2;
    assert_int_equal(choose(&row, "beam", some, 3, -1, ""), 1);
    expect(&row, "a", 0, "the one with the least error; does not hold");
    /* Five times the allowed range error is worse than twice the share of other echo counts. */
    const struct plan_option two[2] = {{"f", 5e-3, 0.0, 1.0, "", BEAM_SINGLE, 0},
                                       {"g", 1e-4, 2e-2, 2.0, "", BEAM_SINGLE, 0}};
    assert_int_equal(choose(&row, "beam", two, 2, -1, ""), 1);
    /* Options go from rough to exact. If all miss by as much, the last possible one is chosen. */
    struct plan_option same[4] = {{"none", 0.0, 1.0, 0.0, "", BEAM_SINGLE, 0},
                                  {"1", 0.0, 1.0, 1.0, "", BEAM_SINGLE, 0},
                                  {"2", 0.0, 1.0, 2.0, "", BEAM_SINGLE, 0},
                                  {"3", 0.0, 1.0, 3.0, "not here", BEAM_SINGLE, 0}};
    assert_int_equal(choose(&row, "optics", same, 4, -1, ""), 2);
}

/* An impossible option is not taken, whatever its figures. The figures of the rest may be unknown. */
static void test_what_cannot_be_had(void **state)
{
    (void)state;
    struct plan_row row;
    struct plan_option some[2] = {{"e", (double)NAN, (double)NAN, 0.0, "", BEAM_SINGLE, 0},
                                  {"f", 0.0, 0.0, 0.0, "the head moves", BEAM_SINGLE, 0}};
    assert_int_equal(choose(&row, "beam", some, 2, -1, ""), 0);
    expect(&row, "e", 0, "the only possible one; its error is not known");
    expect_left(&row, 0, "f", "the head moves");
    assert_false(plan_holds(&some[0], &TOLERANCE) || plan_holds(&some[1], &TOLERANCE));
    /* Where there is one option, it is chosen: d, which would hold, is beyond the end of the list. */
    const struct plan_option alone[2] = {some[0], options[3]};
    assert_int_equal(choose(&row, "beam", alone, 1, -1, ""), 0);
    expect(&row, "e", 0, "the only possible one; its error is not known");
    assert_int_equal(row.n_left, 0);
}

/* For the cast nothing is chosen: the row has the method that is always used. */
static void test_cast(void **state)
{
    (void)state;
    struct plan_row row;
    plan_cast(8, &row);
    expect(&row, "packets of 8, in double", 0, "in double, for any origin of rays");
    assert_true(row.error_m == 1e-6 && row.cost_ns == 0.0 && row.n_left == 0);
}

/* 2,000 million pulses on one triangle each, of a head whose Embree takes 4 rays at once: a map saves dozens of ns. */
static const struct plan_sight_need SIGHT = {
    .pulses = 2e9, .share = 0.8, .n_triangles = 30000, .packet = 4, .memory_bytes = 1 << 30, .forced = -1};
static const struct plan_sight_found PLAIN = {.one = 0.95, .few = 0.05}, MIXED = {.few = 0.1, .ask = 0.9};

static void choose_sight(const struct plan_sight_need *need, const struct plan_sight_found *found, const char *method,
                         const char *why)
{
    struct plan_row row;
    assert_int_equal(plan_sight_choose(need, found, &row), strcmp(method, "map") == 0);
    expect(&row, method, need->forced >= 0, why);
    assert_string_equal(row.stage, "sight");
    assert_true(row.error_m == 0.0 && (need->forced >= 0 || row.cost_ns <= 0.0));
}

/* A map is made where the pulses of a scan pay for it, whatever else is configured. */
static void test_sight_pays(void **state)
{
    (void)state;
    struct plan_sight_need need = SIGHT;
    assert_true(plan_sight_may_pay(&need));
    choose_sight(&need, &PLAIN, "map", "2000 million pulses of a scan pay for a map");
    choose_sight(&need, &MIXED, "none", "a map saves nothing: only 0 % of the pulses");
    need.pulses = 5e4;
    choose_sight(&need, &PLAIN, "none", "0.05 million pulses of a scan do not pay");
    need.pulses = 1e4;
    assert_false(plan_sight_may_pay(&need));
    choose_sight(&need, NULL, "none", "0.01 million pulses of a scan are too few");
    need.n_triangles = 0; /* even without triangles a map costs too much */
    assert_false(plan_sight_may_pay(&need));
    need = SIGHT;
    need.memory_bytes = 1 << 20; /* most cells do not fit, and ask the BVH */
    choose_sight(&need, &(struct plan_sight_found){.one = 0.5, .few = 0.5}, "none", "a map saves nothing");
}

/* A fifth of the saving must be left after the cost (core/plan/README.md). Where all pulses hit one triangle each, a
 * map saves the difference of two costs (core/plan/cost.h). plan_sight_may_pay assumes all rays near borders. */
static void test_sight_pays_to_a_pulse(void **state)
{
    (void)state;
    const struct plan_ray_cost *ray = &plan_ray_costs[2];
    const double build_ns = PLAN_COST_SIGHT + PLAN_COST_SIGHT_TRIANGLE * SIGHT.n_triangles;
    const double least = build_ns / (0.8 * (ray->hit - PLAN_COST_SIGHT_ONE));
    const double may = build_ns / (0.8 * (ray->hit + ray->border - PLAN_COST_SIGHT_ONE));
    struct plan_sight_need need = SIGHT;
    struct plan_row row;
    for (int more = 0; more < 2; more++) {
        need.pulses = least * (more ? 1.000001 : 0.999999);
        assert_int_equal(plan_sight_choose(&need, &(struct plan_sight_found){.one = 1.0}, &row), more);
        need.pulses = may * (more ? 1.000001 : 0.999999);
        assert_int_equal(plan_sight_may_pay(&need), more);
    }
}

/* Rays have the cost of packets of that width, or of the next smaller one in the table. Rays that meet nothing have no
 * other costs, so a map's saving differs by just that. A nanosecond in 1e9 pulses is allowed. */
static void test_sight_packets(void **state)
{
    (void)state;
    static const uint32_t packet[] = {16, 8, 4, 12};
    static const struct plan_sight_found sky = {.nothing = 1.0};
    double saved_ns[4];
    for (int k = 0; k < 4; k++) {
        struct plan_sight_need need = SIGHT;
        struct plan_row row;
        need.packet = packet[k];
        need.forced = 1;
        plan_sight_choose(&need, &sky, &row);
        saved_ns[k] = -row.cost_ns;
        for (size_t i = 0; i < sizeof plan_ray_costs / sizeof plan_ray_costs[0]; i++)
            if (plan_ray_costs[i].packet == packet[k] && k > 0)
                assert_true(fabs(saved_ns[k] - saved_ns[0] - (plan_ray_costs[i].miss - plan_ray_costs[0].miss)) < 1e-9);
    }
    assert_true(saved_ns[0] < saved_ns[1] && saved_ns[1] < saved_ns[2] && saved_ns[3] == saved_ns[1]);
}

/* A map saves the cost of the BVH, and costs its own look-up, by the kinds of cells that pulses go to
 * (core/plan/cost.h). The map's making is shared by all pulses: 60 ns for each cell of several triangles, and what
 * triangles cost. */
static void test_sight_costs(void **state)
{
    (void)state;
    const struct plan_ray_cost *ray = &plan_ray_costs[2];
    const double plane_ns = PLAN_COST_MILLION * 0.5; /* the root of a quarter of a million */
    const struct {
        struct plan_sight_found found;
        double map_ns, bvh_ns;
    } is[] = {{{.one = 1.0}, PLAN_COST_SIGHT_ONE + plane_ns, ray->hit + plane_ns},
              {{.few = 1.0}, PLAN_COST_SIGHT_FEW, ray->hit + plane_ns + ray->border},
              {{.ask = 1.0}, PLAN_COST_SIGHT_ASK, 0.0},
              {{.small = 1.0, .examined = 1e6}, PLAN_COST_SIGHT_SMALL, 0.0}};
    struct plan_sight_need need = SIGHT;
    need.n_triangles = 250000;
    need.memory_bytes = (uint64_t)1 << 40;
    need.forced = 1;
    const double edge = sight_cells(need.pulses / need.share, need.memory_bytes);
    for (size_t i = 0; i < sizeof is / sizeof is[0]; i++) {
        const struct plan_sight_found *f = &is[i].found;
        const double made_ns = PLAN_COST_SIGHT + PLAN_COST_SIGHT_TRIANGLE * 250000 +
                               PLAN_COST_SIGHT_EXAMINED * f->examined +
                               PLAN_COST_SIGHT_CELL * (f->few + f->ask) * need.share * 6.0 * edge * edge;
        const double want_ns = is[i].map_ns - is[i].bvh_ns + made_ns / need.pulses;
        struct plan_row row;
        assert_int_equal(plan_sight_choose(&need, f, &row), 1);
        if (fabs(row.cost_ns - want_ns) > 1e-9) fail_msg("case %zu: %g instead of %g", i, row.cost_ns, want_ns);
    }
}

/* A memory of 32 MiB holds a part of the cells of several triangles (25 bytes each). So the map is made twice, the
 * second time with a quarter of the cells. An outline then crosses twice the share of them. Cells that do not fit
 * then either ask the BVH. The costs are again those of core/plan/cost.h. */
static void test_sight_in_a_small_memory(void **state)
{
    (void)state;
    const struct plan_sight_found found = {.one = 0.7, .nothing = 0.1, .few = 0.15, .ask = 0.05, .examined = 1000.0};
    const struct plan_ray_cost *ray = &plan_ray_costs[2];
    struct plan_sight_need need = SIGHT;
    struct plan_row row;
    need.n_triangles = 250000;
    need.memory_bytes = 32 << 20;
    need.forced = 1;
    const double plane_ns = PLAN_COST_MILLION * 0.5, edge = sight_cells(need.pulses / need.share, need.memory_bytes);
    const double in_view = need.share * 6.0 * edge * edge, fine = 0.2 * in_view, coarse = 0.4 * in_view / 4.0;
    const double memory_bytes = (double)need.memory_bytes, holds = memory_bytes / (25.0 * coarse + 25.0);
    const double fine_holds = memory_bytes / (25.0 * fine + 25.0);
    assert_true(fine_holds < 0.9 && holds < 0.9);
    const double made_ns =
        2.0 * (PLAN_COST_SIGHT + PLAN_COST_SIGHT_TRIANGLE * 250000 + PLAN_COST_SIGHT_EXAMINED * 1000) +
        PLAN_COST_SIGHT_CELL * (fine_holds * fine + holds * coarse);
    const double bvh_ns = 0.1 * ray->miss + 0.9 * (ray->hit + plane_ns) + 0.2 * ray->border;
    /* one, nothing, few and ask of the coarse cells: 0.525, 0.075, 0.3 and 0.1, by the same factor each */
    const double few = holds * 0.3, ask = 0.4 - few;
    const double map_ns =
        0.6 * PLAN_COST_SIGHT_ONE + 0.525 * plane_ns + few * PLAN_COST_SIGHT_FEW + ask * (bvh_ns + PLAN_COST_SIGHT_ASK);
    assert_int_equal(plan_sight_choose(&need, &found, &row), 1);
    const double want_ns = map_ns - bvh_ns + made_ns / need.pulses;
    if (fabs(row.cost_ns - want_ns) > 1e-9) fail_msg("%.12g instead of %.12g", row.cost_ns, want_ns);
}

static void test_sight_forced(void **state)
{
    (void)state;
    struct plan_sight_need need = SIGHT;
    need.forced = 0;
    choose_sight(&need, NULL, "none", "forced by cast.sight");
    need.forced = 1;
    need.pulses = 10.0;
    choose_sight(&need, NULL, "map", "forced by cast.sight; 1e-05 million pulses of a scan are too few");
    need = SIGHT;
    need.why_not = "the head moves";
    choose_sight(&need, NULL, "none", "the head moves");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_cheapest_that_holds),
        cmocka_unit_test(test_forced),
        cmocka_unit_test(test_least_off),
        cmocka_unit_test(test_what_cannot_be_had),
        cmocka_unit_test(test_cast),
        cmocka_unit_test(test_sight_pays),
        cmocka_unit_test(test_sight_pays_to_a_pulse),
        cmocka_unit_test(test_sight_packets),
        cmocka_unit_test(test_sight_costs),
        cmocka_unit_test(test_sight_in_a_small_memory),
        cmocka_unit_test(test_sight_forced),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
