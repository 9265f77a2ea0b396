/* Which of several options, and what the plan says about it. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdio.h>
#include <string.h>
#include <cmocka.h>

#include "core/plan.h"

static const struct plan_tolerance TOLERANCE = {1e-3, 1e-2};

enum { N = 4 };
static const struct plan_option options[N] = {
    {"a", 2e-3, 0.0, 1.0, ""}, {"b", 1e-3, 2e-2, 2.0, ""}, {"c", 1e-4, 1e-3, 9.0, ""}, {"d", 1e-4, 1e-2, 5.0, ""}};

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

/* Of those whose bounds hold the cheapest, wherever it stands; equal to the tolerance holds. */
static void test_cheapest_that_holds(void **state)
{
    (void)state;
    struct plan_row row;
    assert_int_equal(plan_choose(&row, "beam", options, N, -1, "", &TOLERANCE), 3);
    expect(&row, "d", 0, "the cheapest; holds 0.001 m, and 1 % of the pulses");
    assert_string_equal(row.stage, "beam");
    assert_true(row.error_m == 1e-4 && row.echo_share == 1e-2 && row.cost_ns == 5.0);
    assert_int_equal(row.n_left, 3);
    expect_left(&row, 0, "a", "its ranges are off by more than 0.001 m");
    expect_left(&row, 1, "b", "more than 1 % of the pulses get another echo count");
    expect_left(&row, 2, "c", "dearer");
}

static void test_forced(void **state)
{
    (void)state;
    struct plan_row row;
    assert_int_equal(plan_choose(&row, "beam", options, N, 1, "beam.mode", &TOLERANCE), 1);
    expect(&row, "b", 1, "forced by beam.mode; does not hold");
    assert_int_equal(plan_choose(&row, "beam", options, N, 2, "beam.mode", &TOLERANCE), 2);
    expect(&row, "c", 1, "forced by beam.mode; holds");
    expect_left(&row, 2, "d", "not asked for");
}

/* By how often the tolerance it is off: a by 2, b by 3, and so a, however close b's ranges come. */
static void test_least_off(void **state)
{
    (void)state;
    struct plan_row row;
    struct plan_option some[3] = {options[1], options[0], {"e", (double)NAN, (double)NAN, 0.1, ""}};
    some[0].echo_share = 3e-2;
    assert_int_equal(plan_choose(&row, "beam", some, 3, -1, "", &TOLERANCE), 1);
    expect(&row, "a", 0, "the one that is least off; does not hold");
    /* options go from rough to exact: where all miss by as much, the last that can be had */
    struct plan_option same[4] = {{"none", 0.0, 1.0, 0.0, ""},
                                  {"1", 0.0, 1.0, 1.0, ""},
                                  {"2", 0.0, 1.0, 2.0, ""},
                                  {"3", 0.0, 1.0, 3.0, "not here"}};
    assert_int_equal(plan_choose(&row, "optics", same, 4, -1, "", &TOLERANCE), 2);
}

/* What can't be had is not taken, whatever its figures; what is left may be unknown. */
static void test_what_cannot_be_had(void **state)
{
    (void)state;
    struct plan_row row;
    struct plan_option some[2] = {{"e", (double)NAN, (double)NAN, 0.0, ""}, {"f", 0.0, 0.0, 0.0, "the head moves"}};
    assert_int_equal(plan_choose(&row, "beam", some, 2, -1, "", &TOLERANCE), 0);
    expect(&row, "e", 0, "the only one that can be had; what it is off is not known");
    expect_left(&row, 0, "f", "the head moves");
    assert_false(plan_holds(&some[0], &TOLERANCE) || plan_holds(&some[1], &TOLERANCE));
}

/* Float tells surfaces apart to 5e-7 of their distance: at 1 mm, up to 2 km. */
static void test_order(void **state)
{
    (void)state;
    struct plan_row row;
    struct plan_option option[2];
    plan_order_options(1900.0, option);
    assert_int_equal(plan_choose(&row, "order", option, 2, -1, "", &TOLERANCE), 0);
    plan_order_options(2100.0, option);
    assert_int_equal(plan_choose(&row, "order", option, 2, -1, "", &TOLERANCE), 1);
}

/* Rays are not refined where what that is off lies within a tenth of both tolerances: 1e-4 m, and 1e-3 of the pulses.
 */
static void test_cast(void **state)
{
    (void)state;
    static const struct {
        struct plan_option as_is;
        int forced;
        const char *not_plain, *not_by_itself;
        int plain;
        const char *why, *left;
    } cases[] = {
        {{.error_m = 1e-4, .echo_share = 1e-3}, -1, NULL, NULL, 1, "the cheapest; holds 0.001 m", "dearer"},
        {{.error_m = 1.1e-4, .echo_share = 1e-3},
         -1,
         NULL,
         NULL,
         0,
         "in double where float can't",
         "more than 0.0001 m"},
        {{.error_m = 1e-4, .echo_share = 1.1e-3}, -1, NULL, NULL, 0, "in double where float can't", "more than 0.1 %"},
        {{.error_m = (double)NAN, .echo_share = (double)NAN}, -1, NULL, NULL, 0, "in double", "off by more"},
        {{.error_m = 0.0}, -1, "of sub-rays", NULL, 0, "in double where float can't", "of sub-rays"},
        {{.error_m = 0.0}, -1, NULL, "nobody asked", 0, "in double where float can't", "nobody asked"},
        {{.error_m = 5e-4, .echo_share = 5e-3}, 0, NULL, "nobody asked", 1, "forced by cast.refine; holds", "dearer"},
        {{.error_m = 2e-3, .echo_share = 5e-3}, 0, NULL, NULL, 1, "forced by cast.refine; does not hold", "dearer"},
        {{.error_m = (double)NAN, .echo_share = (double)NAN}, 0, NULL, NULL, 1, "is not known", "dearer"},
        {{.error_m = 0.0}, 1, NULL, NULL, 0, "forced by cast.refine; holds", "not asked for"},
    };
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        struct plan_row row;
        const struct plan_cast_need need = {.packet = 8,
                                            .forced = cases[i].forced,
                                            .not_plain = cases[i].not_plain,
                                            .not_by_itself = cases[i].not_by_itself,
                                            .tolerance = TOLERANCE};
        assert_int_equal(plan_cast(&need, &cases[i].as_is, &row), cases[i].plain);
        expect(&row, cases[i].plain ? "packets of 8, float" : "packets of 8, decided", cases[i].forced >= 0,
               cases[i].why);
        expect_left(&row, 0, cases[i].plain ? "packets of 8, decided" : "packets of 8, float", cases[i].left);
        assert_true(cases[i].plain ? row.cost_ns < 0.0 : row.cost_ns == 0.0);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_cheapest_that_holds), cmocka_unit_test(test_forced), cmocka_unit_test(test_least_off),
        cmocka_unit_test(test_what_cannot_be_had),  cmocka_unit_test(test_order),  cmocka_unit_test(test_cast),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
