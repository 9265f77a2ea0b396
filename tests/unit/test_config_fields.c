/* SPDX-License-Identifier: MIT */
/* Monitored fields of a configuration: what is refused, and the shapes that are made of the keys. */
#include "drivers/protocol/cola_field.h"
#include "tests/unit/config_rig.h"

#define SEGMENT "number: 1, shape: segment, angles_deg: [0, 90], radii_m: [0, 1]"

static void fields_that_say_nothing_are_refused(void **state)
{
    (void)state;
    static const struct {
        const char *profile, *field, *says;
    } cases[] = {
        {"sick-tim781", "{" SEGMENT "}", NULL},
        {"sick-tim571", "{" SEGMENT "}", "fields: a TiM571 evaluates no fields"},
        {"sick-tim781", "{shape: segment, angles_deg: [0, 90], radii_m: [0, 1]}", "fields[0].number: missing"},
        {"sick-tim781", "{number: 1}", "fields[0].shape: missing"},
        {"sick-tim781", "{number: 49, shape: segment}", "allowed a whole number, 1 to 48"},
        {"sick-lms111", "{number: 11, shape: segment, angles_deg: [0, 90], radii_m: [0, 1]}",
         "fields[0].number: 11, but a LMS111 has 10 fields; allowed 1 to 10"},
        {"sick-tim781", "{" SEGMENT "}, {" SEGMENT "}", "fields[1].number: 1 is the number of fields[0], too"},
        {"sick-tim781", "{" SEGMENT ", size_m: [1, 1]}", "fields[0].size_m: given, but the field is a segment"},
        {"sick-tim781", "{number: 1, shape: segment, angles_deg: [0, 90]}",
         "fields[0].radii_m: missing; required with "},
        {"sick-tim781", "{number: 1, shape: segment, angles_deg: [90, 0], radii_m: [0, 1]}",
         "a second angle of 0 to 360"},
        {"sick-tim781", "{number: 1, shape: segment, angles_deg: [0, 361], radii_m: [0, 1]}",
         "a second angle of 0 to "},
        {"sick-tim781", "{number: 1, shape: segment, angles_deg: [0, 9], radii_m: [2, 1]}",
         "that is not below the inner"},
        {"sick-tim781", "{number: 1, shape: polygon}", "fields[0].points_m: missing; required with shape: polygon"},
        {"sick-tim781", "{number: 1, shape: polygon, points_m: [[0, 1], [1, 1]]}", "2 corners; allowed 3 to 62"},
        {"sick-tim781", "{number: 1, shape: polygon, points_m: []}", "0 corners; allowed 3 to 62"},
        {"sick-tim781", "{number: 1, shape: polygon, points_m: [[1, 2], [1, 2], [1, 2]]}",
         "its 3 corners enclose no area"},
        {"sick-tim781", "{number: 1, shape: polygon, points_m: [[0.1, 0.1], [0.2, 0.2], [0.7, 0.7], [0.3, 0.3]]}",
         "its 4 corners enclose no area"},
        {"sick-tim781", "{number: 1, shape: polygon, points_m: [[0, 0], [1, 1], [1, 0], [0, 1]]}",
         NULL}, /* crosses itself */
        {"sick-tim781", "{number: 1, shape: polygon, points_m: 3}", "allowed [[x, y], ...], each -1000 to 1000 m"},
        {"sick-tim781", "{number: 1, shape: polygon, points_m: [[0, 1], [1], [1, 1]]}", "point 2 is not two numbers"},
        {"sick-tim781", "{number: 1, shape: polygon, points_m: [[0, 1], [1, x], [1, 1]]}", "\"x\" is not a number"},
        {"sick-tim781", "{number: 1, shape: polygon, points_m: [[0, 1], [1, 1001], [1, 1]]}", "out of range"},
        {"sick-tim781", "{number: 1, shape: rectangle, corner_m: [900, 0], size_m: [200, 1]}", "reaches farther than"},
        {"sick-tim781", "{number: 1, shape: rectangle, corner_m: [900, 0], size_m: [100, 1]}", NULL},
        {"sick-tim781", "{" SEGMENT ", output: 1}", "fields[0].output: given, but a TiM781 has an output for each"},
        {"sick-lms111", "{" SEGMENT ", output: 3}", NULL},
        {"sick-lms111", "{" SEGMENT "}]\ninputs: [{input: 5}", "inputs[0].input: \"5\" is out of range"},
        {"sick-lms111", "{" SEGMENT "}]\ninputs: [{input: 1, from_s: 2, until_s: 2}", "but it begins at 2 s"},
    };
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        char with[300];
        snprintf(with, sizeof with, "fields: [%s]\n", cases[i].field);
        load_with_head(cases[i].profile, "", with);
        if (cases[i].says == NULL ? err.code != SH_OK
                                  : err.code != SH_EINPUT || strstr(err.text, cases[i].says) == NULL)
            fail_msg("%s: \"%s\", expected \"%s\"", cases[i].field, err.text,
                     cases[i].says != NULL ? cases[i].says : "nothing");
    }
}

static void keys_make_shapes(void **state)
{
    (void)state;
    static struct cola_fields made;
    load_with_head(
        "sick-tim781", "",
        "fields:\n"
        "  - {number: 2, name: left, shape: polygon, points_m: [[-1, 0.5], [1.25, 0.5], [0, 2]], response_ms: 134}\n"
        "  - {number: 48, shape: segment, angles_deg: [350, 370.5], radii_m: [0.25, 3], blanking_m: 0.1}\n"
        "  - {number: 5, shape: rectangle, corner_m: [1, 2], size_m: [3, 4], turn_deg: 90}\n");
    assert_int_equal(err.code, SH_OK);
    config_fill_fields(cfg, &made);
    const struct cola_field *f = &made.field[1];
    assert_string_equal(f->name, "left");
    assert_int_equal(f->response_ms, 134);
    assert_int_equal(f->shape.kind, COLA_SHAPE_POLYGON);
    assert_int_equal(f->shape.n, 3);
    assert_true(f->shape.corner[0].x_um == -1000000 && f->shape.corner[0].y_um == 500000);
    assert_true(f->shape.corner[1].x_um == 1250000 && f->shape.corner[1].y_um == 500000);
    assert_true(f->shape.corner[2].x_um == 0 && f->shape.corner[2].y_um == 2000000);
    f = &made.field[47];
    assert_int_equal(f->shape.kind, COLA_SHAPE_SECTOR);
    assert_int_equal(f->blanking_um, 100000);
    assert_true(f->shape.sector.start_e4 == 3500000 && f->shape.sector.span_e4 == 205000);
    assert_true(f->shape.sector.inner_um == 250000 && f->shape.sector.outer_um == 3000000);
    f = &made.field[4];
    assert_int_equal(f->shape.n, 4);
    assert_true(f->shape.corner[0].x_um == 1000000 && f->shape.corner[0].y_um == 2000000);
    assert_true(f->shape.corner[2].x_um == -3000000 && f->shape.corner[2].y_um == 5000000);
    assert_int_equal(made.field[0].shape.kind, COLA_SHAPE_NONE);
}

/* Each field has all that its keys say, in micrometres, nanoseconds and turns. */
static void all_that_keys_say_is_there(void **state)
{
    (void)state;
    static struct cola_fields made;
    const struct config_field rectangle = {.name = "gate",
                                           .shape = FIELD_RECTANGLE,
                                           .corner_m = {1.0, -2.0},
                                           .size_m = {3.0, 0.5},
                                           .turn_deg = -90.0,
                                           .response_ms = 66,
                                           .output = 2,
                                           .blanking_m = 0.000002};
    struct cola_field field;
    config_make_field(&rectangle, &field);
    assert_true(field.is_rectangle == 1 && field.turns == -0.25 && field.output == 2 && field.response_ms == 66);
    assert_true(field.corner_um[0] == 1e6 && field.corner_um[1] == -2e6);
    assert_true(field.size_um[0] == 3e6 && field.size_um[1] == 5e5 && field.blanking_um == 2);
    assert_string_equal(field.name, "gate");
    assert_true(field.has_record == 0 && field.shape.kind == COLA_SHAPE_POLYGON && field.shape.n == 4);
    load_with_head("sick-lms111", "",
                   "fields: [{" SEGMENT ", output: 3}]\n"
                   "inputs: [{input: 4, from_s: 0.5, until_s: 1.25}, {input: 1, until_s: 3e-9}]\n");
    assert_int_equal(err.code, SH_OK);
    memset(&made, 0xff, sizeof made);
    config_fill_fields(cfg, &made);
    assert_true(made.field[0].output == 3 && made.field[0].is_rectangle == 0 && made.field[0].turns == 0.0);
    assert_int_equal(made.n_windows, 2);
    assert_true(made.window[0].input == 3 && made.window[0].from_ns == 500000000 &&
                made.window[0].until_ns == 1250000000);
    assert_true(made.window[1].input == 0 && made.window[1].from_ns == 0 && made.window[1].until_ns == 3);
    for (size_t i = 1; i < COLA_FIELDS; i++)
        assert_int_equal(made.field[i].shape.kind, COLA_SHAPE_NONE);
}

/* Equal radii, no width and a whole turn are allowed; corners that enclose less than half a square micrometre are not.
 */
static void shapes_have_limits(void **state)
{
    (void)state;
    static const struct {
        const char *field;
        int fits;
    } cases[] = {
        {"shape: segment, angles_deg: [0, 360], radii_m: [1, 1]", 1},
        {"shape: segment, angles_deg: [5, 5], radii_m: [0, 1]", 1},
        {"shape: segment, angles_deg: [-1, 359.1], radii_m: [0, 1]", 0},
        {"shape: segment, angles_deg: [5, 4.9], radii_m: [0, 1]", 0},
        {"shape: segment, angles_deg: [0, 90], radii_m: [1.1, 1]", 0},
        {"shape: polygon, points_m: [[0, 0], [1e-6, 0], [0, 1e-6]]", 1},
        {"shape: polygon, points_m: [[0, 0], [1e-6, 0], [0, 0.9e-6]]", 0},
        {"shape: polygon, points_m: [[5, 5], [6, 5], [7, 5], [8, 5], [8, 6]]", 1},
        {"shape: polygon, points_m: [[5, 5], [6, 6], [7, 7], [8, 8], [9, 9]]", 0},
        {"shape: rectangle, corner_m: [0, 0], size_m: [1000, 1000]", 1},
        {"shape: rectangle, corner_m: [0, 0], size_m: [1000, 1000], turn_deg: 45", 0}, /* a corner at 1414 m */
    };
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        char with[300];
        snprintf(with, sizeof with, "fields: [{number: 48, %s}]\n", cases[i].field);
        load_with_head("sick-tim781", "", with);
        if ((err.code == SH_OK) != cases[i].fits) fail_msg("%s: %s", cases[i].field, err.text);
    }
}

/* There is room for 62 points, and all of them arrive. */
static void the_longest_list_of_points(void **state)
{
    (void)state;
    char with[2048];
    for (int n = CONFIG_MAX_POINTS; n <= CONFIG_MAX_POINTS + 1; n++) {
        int len = snprintf(with, sizeof with, "fields: [{number: 1, shape: polygon, points_m: [");
        for (int i = 0; i < n; i++)
            len += snprintf(with + len, sizeof with - (size_t)len, "%s[%d.5, %d]", i > 0 ? ", " : "", i, i % 7);
        snprintf(with + len, sizeof with - (size_t)len, "]}]\n");
        load_with_head("sick-tim781", "", with);
        if (n > CONFIG_MAX_POINTS) break;
        assert_int_equal(err.code, SH_OK);
        assert_int_equal(cfg->field[0].points_m.n, n);
        for (int i = 0; i < n; i++)
            assert_true(cfg->field[0].points_m.at[i][0] == i + 0.5 && cfg->field[0].points_m.at[i][1] == i % 7);
    }
    assert_int_equal(err.code, SH_EINPUT);
    assert_says("fields[0].points_m: has 63 points; allowed up to 62");
}

/* A list of points can be set, and it replaces the one before. */
static void points_can_be_set(void **state)
{
    (void)state;
    const char *const sets[] = {"fields.0.points_m=[[0, 0], [2, 0], [2, 2]]"};
    load_with_head("sick-tim781", "",
                   "fields: [{number: 1, shape: polygon, points_m: [[0, 0], [1, 0], [1, 1], [0, 1]]}]\n");
    assert_int_equal(err.code, SH_OK);
    load_sets(sets, 1);
    assert_int_equal(err.code, SH_OK);
    assert_int_equal(cfg->field[0].points_m.n, 3);
    assert_true(cfg->field[0].points_m.at[2][1] == 2.0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(fields_that_say_nothing_are_refused), cmocka_unit_test(keys_make_shapes),
        cmocka_unit_test(all_that_keys_say_is_there),          cmocka_unit_test(shapes_have_limits),
        cmocka_unit_test(the_longest_list_of_points),          cmocka_unit_test(points_can_be_set)};
    return cmocka_run_group_tests_name("config fields", tests, set_up, tear_down);
}
