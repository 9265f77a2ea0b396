/* SPDX-License-Identifier: MIT */
/* Surfaces that their file calls transparent, and the rules that are offered for them. Names come from files, so they
 * may have any bytes. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>
#include <cmocka.h>

#include "firmware_sim/site/site.h"

static struct scene_surface named(const char *material, const char *object, double clear)
{
    struct scene_surface s = {.clear = (float)clear};
    snprintf(s.material, sizeof s.material, "%s", material);
    snprintf(s.object, sizeof s.object, "%s", object);
    return s;
}

static void rules_fit_their_names_alone(void **state)
{
    (void)state;
    static const struct {
        const char *material, *object;
        double clear;
        const char *rule;
    } rows[] = {
        {"pane", "house", 0.75, "{material: \"pane\", glass: 0.75}"},
        {"", "house", 0.75, "{object: \"house\", glass: 0.75}"},
        {"pane", "", 1.0, "{material: \"pane\", glass: 0.9}"}, /* some light is scattered */
        {"a*b?c[d", "", 0.5, "{material: \"a\\\\*b\\\\?c[d\", glass: 0.5}"},
        {"a\\b", "", 0.5, "{material: \"a\\\\b\", glass: 0.5}"},
        {"say \"a\"", "", 0.5, "{material: \"say \\\"a\\\"\", glass: 0.5}"},
        {"\x01\x1f \x7e\x7f", "", 0.5, "{material: \"\\x01\\x1f ~\\x7f\", glass: 0.5}"},
        {"K\xc3\xbc", "", 0.5, "{material: \"K\xc3\xbc\", glass: 0.5}"},
    };
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        struct site_clear c = {0};
        const struct scene_surface s = named(rows[i].material, rows[i].object, rows[i].clear);
        site_clear_add(&c, &s, NULL, 0);
        assert_int_equal(c.n, 1);
        assert_string_equal(c.rules, rows[i].rule);
    }
}

/* Less than a hundredth may be a rounding of the file. */
static void hardly_clear_surfaces_are_not_offered(void **state)
{
    (void)state;
    static const double clear[] = {0.0, 0.0099, 0.0101, 0.5};
    for (int i = 0; i < 4; i++) {
        struct site_clear c = {0};
        const struct scene_surface s = named("pane", "", clear[i]);
        site_clear_add(&c, &s, NULL, 0);
        assert_int_equal(c.n, i >= 2);
    }
}

/* The first rule whose patterns fit decides, as in a scan. */
static void what_a_rule_decides_is_not_offered(void **state)
{
    (void)state;
    const struct surface none = {.glass = (double)NAN, .mirror = (double)NAN};
    struct surface_rule rule[2] = {{.object = "*", .material = "pane*", .surface = none},
                                   {.object = "*", .material = "*", .surface = none}};
    const struct scene_surface s = named("pane-1", "house", 0.5);
    static const struct {
        int rule, glass, mirror; /* which rule says one of them */
        uint32_t n;
    } rows[] = {{0, 0, 0, 1}, {0, 1, 0, 0}, {0, 0, 1, 0}, {1, 1, 0, 1}};
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        struct surface_rule at[2] = {rule[0], rule[1]};
        struct site_clear c = {0};
        if (rows[i].glass) at[rows[i].rule].surface.glass = 0.0;
        if (rows[i].mirror) at[rows[i].rule].surface.mirror = 0.0;
        site_clear_add(&c, &s, at, 2);
        assert_int_equal(c.n, rows[i].n);
    }
    snprintf(rule[0].object, sizeof rule[0].object, "garage");
    rule[0].surface.glass = 0.5;
    struct site_clear c = {0};
    site_clear_add(&c, &s, rule, 2);
    assert_int_equal(c.n, 1); /* it is for another object */
}

static void each_rule_is_offered_once_as_far_as_there_is_room(void **state)
{
    (void)state;
    static const char first[] = "{material: \"a\", glass: 0.5}",
                      both[] = "{material: \"a\", glass: 0.5}, {material: \"b\", glass: 0.5}";
    const struct scene_surface a = named("a", "", 0.5), b = named("b", "", 0.5), opaque = named("c", "", 0.0);
    struct site_clear c = {0};
    site_clear_add(&c, &a, NULL, 0);
    site_clear_add(&c, &a, NULL, 0);
    site_clear_add(&c, &opaque, NULL, 0);
    site_clear_add(&c, &b, NULL, 0);
    assert_true(c.n == 3 && c.n_left_out == 0);
    assert_string_equal(c.rules, both);
    for (size_t short_by = 0; short_by < 2; short_by++) {
        c = (struct site_clear){.room = sizeof both - short_by};
        site_clear_add(&c, &a, NULL, 0);
        site_clear_add(&c, &b, NULL, 0);
        assert_true(c.n == 2 && c.n_left_out == short_by);
        assert_string_equal(c.rules, short_by ? first : both);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(rules_fit_their_names_alone),
        cmocka_unit_test(hardly_clear_surfaces_are_not_offered),
        cmocka_unit_test(what_a_rule_decides_is_not_offered),
        cmocka_unit_test(each_rule_is_offered_once_as_far_as_there_is_room),
    };
    return cmocka_run_group_tests_name("transparent surfaces", tests, NULL, NULL);
}
