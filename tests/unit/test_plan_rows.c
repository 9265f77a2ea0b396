/* SPDX-License-Identifier: MIT */
/* Rows of the plan for stages with little to choose, and for georeferencing: their words and figures are those of the
 * settings (core/plan.h). */
#include <math.h>

#include "core/plan.h"
#include "core/plan/cost.h"
#include "tests/unit/georef_rig.h"

struct want {
    const char *stage, *method, *why;
    int costs; /* the stage costs something */
};

/* Stages that are off cost nothing; those that are on cost something, and only movers' cost depends on the scene. */
static void expect_rows(const struct plan_head *head, const struct want *want, size_t n)
{
    struct plan_row row[PLAN_HEAD_ROWS + 1];
    assert_int_equal(plan_head(head, row), n);
    for (size_t i = 0; i < n; i++) {
        assert_string_equal(row[i].stage, want[i].stage);
        assert_string_equal(row[i].method, want[i].method);
        if (strstr(row[i].why, want[i].why) == NULL) fail_msg("%s: %s", row[i].stage, row[i].why);
        if (want[i].costs != (row[i].cost_ns != 0.0)) fail_msg("%s costs %g ns", row[i].stage, row[i].cost_ns);
        assert_true(i == 0 || row[i].cost_ns >= 0.0);
        assert_true(row[i].error_m == (i == 0 && want[i].costs ? 1e-6 : 0.0) && row[i].n_left == 0);
    }
}

static void a_head_with_nothing_on(void **state)
{
    (void)state;
    static const struct plan_head head = {.ambiguity = DETECT_AMBIGUITY_NONE, .range_sigma_m = 0.1, .reach_m = 5.0};
    static const struct want want[] = {{"movers", "none", "no mesh moves", 0},
                                       {"signal", "none", "signal.model is off", 0},
                                       {"noise", "none", "noise.range is off", 0},
                                       {"zones", "none", "head.ambiguity is none", 0},
                                       {"geometry", "none", "instrument is all zero, noise.angle off", 0}};
    expect_rows(&head, want, 5);
}

static void a_head_with_all_on(void **state)
{
    (void)state;
    static const struct plan_head head = {.n_movers = 1,
                                          .noise_on = 1,
                                          .range_sigma_m = 0.005,
                                          .range_sigma_ppm = 20.0,
                                          .range_sigma_at_m = 100.0,
                                          .ball_radius_m = 0.25,
                                          .signal = 1,
                                          .reach_m = 1234.0,
                                          .ambiguity = DETECT_RESOLVED,
                                          .instrument = 1};
    static const struct want want[] = {
        {"movers", "cast separately", "meshes that move", 1},
        {"signal", "range equation", "targets vanish by chance; the largest reach in the head profile is 1234 m", 1},
        {"noise", "gauss, by signal", "sigma 0.005 m at 100 m, elsewhere it depends on the signal, and 20 ppm", 1},
        {"ball", "uniform in a ball", "points move by up to 0.25 m", 1},
        {"zones", "resolved", "echoes that return after the next pulse", 1},
        {"geometry", "errors of geometry", "points follow the encoders", 1}};
    struct plan_row row[PLAN_HEAD_ROWS];
    expect_rows(&head, want, 6);
    plan_head(&head, row);
    assert_true(isnan(row[0].cost_ns));
}

static void each_choice_of_a_head(void **state)
{
    (void)state;
    static const struct {
        struct plan_head head;
        size_t row;
        struct want want;
    } is[] = {{{.signal = 1, .sharp = 1, .reach_m = 50.0}, 1, {"signal", "range equation", "vanish sharply; ", 1}},
              {{.noise_on = 1, .range_sigma_m = 0.01, .range_sigma_ppm = 3.0},
               2,
               {"noise", "gauss", "sigma 0.01 m and 3 ppm; noise of the head", 1}},
              {{.ambiguity = DETECT_FOLDED}, 3, {"zones", "folded", "after the next pulse", 1}},
              {{.angle_noise = 1}, 4, {"geometry", "angle noise", "points follow the encoders", 1}}};
    for (size_t i = 0; i < sizeof is / sizeof is[0]; i++) {
        const struct want *want = &is[i].want;
        struct plan_row row[PLAN_HEAD_ROWS];
        assert_int_equal(plan_head(&is[i].head, row), 5);
        assert_string_equal(row[is[i].row].stage, want->stage);
        assert_string_equal(row[is[i].row].method, want->method);
        if (strstr(row[is[i].row].why, want->why) == NULL) fail_msg("%s", row[is[i].row].why);
        for (size_t k = 0; k < 5; k++)
            if ((row[k].cost_ns > 0.0) != (k == is[i].row)) fail_msg("%s: %g ns", row[k].stage, row[k].cost_ns);
    }
}

static void the_mesh(void **state)
{
    (void)state;
    struct plan_row row;
    plan_mesh(0.0, &row);
    assert_string_equal(row.stage, "mesh");
    assert_string_equal(row.method, "double");
    assert_true(row.error_m == 0.0 && row.cost_ns == 0.0);
    plan_mesh(1e-4, &row);
    assert_string_equal(row.method, "single precision");
    assert_true(row.error_m == 1e-4 && row.cost_ns == 0.0);
    assert_non_null(strstr(row.why, "rounded to single precision"));
}

/* k rings around a ray have 6, 12, 18, ... rays. Each ray costs as much; the errors are not known yet. */
static void beams(void **state)
{
    (void)state;
    struct plan_option option;
    uint32_t rays = 1;
    for (uint32_t k = 1; k <= 12; k++) {
        char want[32];
        rays += 6 * k;
        snprintf(want, sizeof want, "rings %u (%u rays)", k, rays);
        plan_beam_option(BEAM_RINGS, k, &option);
        assert_string_equal(option.method, want);
        assert_true(option.cost_ns == rays * PLAN_COST_SUB_RAY);
        assert_true(isnan(option.error_m) && isnan(option.echo_share) && option.why_not[0] == '\0');
    }
    plan_beam_option(BEAM_ADAPTIVE, 4, &option);
    assert_string_equal(option.method, "adaptive");
    assert_true(isnan(option.cost_ns) && isnan(option.error_m) && isnan(option.echo_share));
    plan_beam_option(BEAM_SINGLE, 4, &option);
    assert_string_equal(option.method, "single");
    assert_true(option.cost_ns == 0.0 && isnan(option.error_m) && isnan(option.echo_share));
}

/* A pulse costs more with a larger scene, up to a million triangles, and with a narrower packet. */
static void a_pulse(void **state)
{
    (void)state;
    const double none_ns = plan_pulse_ns(0.0, 16);
    assert_true(none_ns == PLAN_COST_PULSE + plan_ray_costs[0].hit);
    assert_true(fabs(plan_pulse_ns(250000.0, 16) - none_ns - 0.5 * PLAN_COST_MILLION) < 1e-9);
    assert_true(fabs(plan_pulse_ns(1e8, 16) - none_ns - PLAN_COST_MILLION) < 1e-9);
    assert_true(fabs(plan_pulse_ns(0.0, 4) - none_ns - plan_ray_costs[2].hit + plan_ray_costs[0].hit) < 1e-9);
}

/* ---- georeferencing */

static const char *const names[] = {[GEOREF_EXACT] = "exact",
                                    [GEOREF_ORDER1] = "order1",
                                    [GEOREF_ORDER2] = "order2",
                                    [GEOREF_ORDER3] = "order3",
                                    [GEOREF_ORDER5] = "order5"};

static const struct plan_option *left_out(const struct plan_row *row, enum georef_method method)
{
    for (uint32_t i = 0; i < row->n_left; i++)
        if (strcmp(row->left[i].method, names[method]) == 0) return &row->left[i];
    fail_msg("%s is not left out", names[method]);
    return NULL;
}

/* All methods but the chosen one are left out, each with its own bound. */
static enum georef_method planned(const struct georef *georef, const struct plan_georef_need *need,
                                  struct plan_row *row)
{
    enum georef_method method;
    struct sh_err err;
    assert_int_equal(plan_georef(georef, need, &method, row, &err), SH_OK);
    assert_string_equal(row->stage, "georef");
    assert_string_equal(row->method, names[method]);
    assert_true(row->error_m == georef_bound_m(georef, method, need->radius_m, need->height_m));
    assert_int_equal(row->forced, need->forced != GEOREF_AUTO);
    assert_int_equal(row->n_left, 4);
    for (enum georef_method m = GEOREF_EXACT; m <= GEOREF_ORDER5; m++) {
        if (m == method) continue;
        const double bound_m = georef_bound_m(georef, m, need->radius_m, need->height_m);
        assert_true(left_out(row, m)->error_m == bound_m);
        if (!isfinite(bound_m)) assert_string_equal(left_out(row, m)->why_not, "its error has no bound here");
    }
    return method;
}

/* The tolerance equals the bound of a method, and this method still holds. */
static void the_cheapest_polynomial_that_holds(void **state)
{
    (void)state;
    struct georef *georef = make(GEOREF_UTM, 48.0, 11.0, 500.0, 0);
    struct plan_georef_need need = {.radius_m = 200.0, .height_m = 50.0};
    struct plan_row row;
    need.tolerance_m = georef_bound_m(georef, GEOREF_ORDER2, need.radius_m, need.height_m);
    assert_true(georef_bound_m(georef, GEOREF_ORDER1, need.radius_m, need.height_m) > need.tolerance_m);
    assert_int_equal(planned(georef, &need, &row), GEOREF_ORDER2);
    assert_string_equal(left_out(&row, GEOREF_ORDER1)->why_not, "its error is above the tolerance");
    assert_string_equal(left_out(&row, GEOREF_ORDER3)->why_not, "costs more, or is not better");
    assert_string_equal(left_out(&row, GEOREF_EXACT)->why_not, "costs more, or is not better");
    assert_true(row.cost_ns > left_out(&row, GEOREF_ORDER1)->cost_ns);
    assert_true(row.cost_ns < left_out(&row, GEOREF_ORDER3)->cost_ns);
    assert_true(left_out(&row, GEOREF_EXACT)->cost_ns > 100.0); /* core/georef.h: 0.2 us or more for each point */
    char want[sizeof row.why];
    snprintf(want, sizeof want,
             "the cheapest that meets the tolerance: %.3g m for points up to 200 m away, 50 m up or down",
             need.tolerance_m);
    assert_string_equal(row.why, want);
    need.tolerance_m = 1e-7;
    need.radius_m = 103000.0;
    need.height_m = 1000.0;
    assert_int_equal(planned(georef, &need, &row), GEOREF_EXACT);
    assert_non_null(strstr(
        row.why, "no polynomial meets the tolerance: 1e-07 m for points up to 1.03e+05 m away, 1000 m up or down"));
    need.tolerance_m = 1e-9; /* GeographicLib itself has 5 nm */
    assert_int_equal(planned(georef, &need, &row), GEOREF_EXACT);
    assert_non_null(strstr(row.why, "no method meets the tolerance"));
    georef_free(georef);
}

/* Geodetic positions of single points are cheaper than those in UTM, says core/georef.h. */
static void a_method_that_is_asked_for(void **state)
{
    (void)state;
    struct georef *utm = make(GEOREF_UTM, 48.0, 11.0, 500.0, 0),
                  *geodetic = make(GEOREF_GEODETIC, 48.0, 11.0, 500.0, 0);
    struct plan_georef_need need = {.radius_m = 200.0, .height_m = 50.0, .tolerance_m = 1e-3, .forced = GEOREF_ORDER3};
    struct plan_row row, other;
    enum georef_method method;
    struct sh_err err;
    assert_int_equal(planned(utm, &need, &row), GEOREF_ORDER3);
    assert_non_null(strstr(row.why, "asked for by output.georef: 0.001 m for points up to 200 m away"));
    assert_string_equal(left_out(&row, GEOREF_ORDER2)->why_not, "not asked for");
    assert_string_equal(left_out(&row, GEOREF_EXACT)->why_not, "not asked for");
    need.forced = GEOREF_EXACT;
    assert_int_equal(planned(utm, &need, &row), GEOREF_EXACT);
    assert_int_equal(planned(geodetic, &need, &other), GEOREF_EXACT);
    assert_true(other.cost_ns < row.cost_ns && other.cost_ns > 0.0);
    need.forced = GEOREF_ORDER5; /* which only grids have */
    assert_int_equal(plan_georef(utm, &need, &method, &row, &err), SH_EINPUT);
    assert_string_equal(err.text, "georeferencing by order5 has no bound for points up to 200 m away; allowed exact");
    georef_free(geodetic);
    georef_free(utm);
}

static void no_map_is_needed(void **state)
{
    (void)state;
    struct georef *local = make(GEOREF_LOCAL, 48.0, 11.0, 500.0, 0), *ecef = make(GEOREF_ECEF, 48.0, 11.0, 500.0, 0);
    const struct plan_georef_need need = {.radius_m = 2000.0, .height_m = 500.0, .tolerance_m = 1e-6};
    struct plan_row row;
    enum georef_method method;
    struct sh_err err;
    assert_int_equal(plan_georef(local, &need, &method, &row, &err), SH_OK);
    assert_int_equal(method, GEOREF_EXACT);
    assert_string_equal(row.stage, "georef");
    assert_string_equal(row.method, "none");
    assert_true(row.error_m == 0.0 && row.cost_ns == 0.0 && row.n_left == 0 && !row.forced);
    assert_non_null(strstr(row.why, "points stay in the scene frame"));
    assert_int_equal(plan_georef(ecef, &need, &method, &row, &err), SH_OK);
    assert_int_equal(method, GEOREF_EXACT);
    assert_string_equal(row.method, "rotation");
    assert_true(row.error_m == georef_bound_m(ecef, GEOREF_EXACT, 2000.0, 500.0) && row.error_m > 0.0);
    assert_non_null(strstr(row.why, "ECEF is a rotation"));
    plan_georef_polar(&row);
    assert_string_equal(row.stage, "georef");
    assert_string_equal(row.method, "none");
    assert_true(row.error_m == 0.0 && row.cost_ns == 0.0);
    assert_non_null(strstr(row.why, "output.layout is polar"));
    georef_free(ecef);
    georef_free(local);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_head_with_nothing_on),
        cmocka_unit_test(a_head_with_all_on),
        cmocka_unit_test(each_choice_of_a_head),
        cmocka_unit_test(the_mesh),
        cmocka_unit_test(beams),
        cmocka_unit_test(a_pulse),
        cmocka_unit_test(the_cheapest_polynomial_that_holds),
        cmocka_unit_test(a_method_that_is_asked_for),
        cmocka_unit_test(no_map_is_needed),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
