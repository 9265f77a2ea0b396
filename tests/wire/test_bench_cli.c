/* SPDX-License-Identifier: MIT */
/* build/bench: the JSON has the keys that scripts rely on, plausible figures, and stages that add up. The program is
 * $BENCH, or `bench` beside $SCANHEAD. */
#include "tests/wire/wire.h"

#include <math.h>

static int bench(struct wire *wire, const char *const *args)
{
    const char *head = wire_program(), *slash = strrchr(head, '/'), *given = getenv("BENCH");
    char program[352];
    if (given != NULL && given[0] != '\0')
        snprintf(program, sizeof program, "%s", given);
    else
        snprintf(program, sizeof program, "%.*sbench", slash != NULL ? (int)(slash + 1 - head) : 0, head);
    return wire_wait(wire, wire_spawn_program(wire, program, args, "out", "err", -1));
}

/* Returns the number after "key": at or after `from`. */
static double number_of(const char *from, const char *key)
{
    char quoted[64], *end;
    snprintf(quoted, sizeof quoted, "\"%s\": ", key);
    const char *at = strstr(from, quoted);
    if (at == NULL) fail_msg("no %s in the JSON", quoted);
    double value = strtod(at + strlen(quoted), &end);
    if (end == at + strlen(quoted)) fail_msg("%s: not a number", key);
    return value;
}

static void test_keys(void **state)
{
    static const char *const args[] = {"--scenes", "10k", "--seconds", "0.1", "--pulses", "none", NULL};
    static const char *const stages[] = {"schedule", "directions", "embree", "refine", "detect",
                                         "noise",    "georef",     "encode", "crc",    "rest"};
    struct wire *wire = *state;
    assert_int_equal(bench(wire, args), 0);
    char *text = wire_read(wire_path(wire, "out"), NULL);
    const char *scenes = strstr(text, "\"scenes\": [");
    assert_non_null(scenes);
    assert_non_null(strstr(scenes, "\"scene\": \"10k\""));
    double n = number_of(scenes, "triangles");
    assert_true(n > 9000 && n < 11000);
    assert_true(number_of(scenes, "embree_mrays_s") > 0.0);
    double cast = number_of(scenes, "cast_ratio"), pipeline = number_of(scenes, "pipeline_ratio");
    assert_true(cast > 0.0 && pipeline > 0.0);
    /* The pipeline does all of the cast and more. A tenth is left for other work of the machine. */
    assert_true(pipeline < 1.1 * cast);
    const char *ns = strstr(scenes, "\"ns_per_pulse\": {");
    assert_non_null(ns);
    double sum = 0.0;
    for (size_t i = 0; i < sizeof stages / sizeof stages[0]; i++)
        sum += number_of(ns, stages[i]);
    assert_true(fabs(sum - number_of(scenes, "pipeline_ns")) <
                1e-6 * sum); /* with the rest they are the whole, up to rounding */
    assert_non_null(strstr(scenes, "\"stages_give_same_bytes\": true"));
    assert_true(number_of(scenes, "pulses_per_s_all_threads") > 0.0);
    free(text);
}

/* For whole scans the ratio includes the time to build a sight. The sight changes no hit. */
static void test_sight(void **state)
{
    static const char *const args[] = {"--scenes", "10k", "--only-sight", "--pulses", "50k,100k", NULL};
    static const char *const parts[] = {
        "cast_ratio_without", "pipeline_ratio", "gain", "plan_ratio", "build", "cells", "peak_mib"};
    struct wire *wire = *state;
    assert_int_equal(bench(wire, args), 0);
    char *text = wire_read(wire_path(wire, "out"), NULL), *at = strstr(text, "\"sight\": [");
    assert_non_null(at);
    for (int i = 0; i < 2; i++) {
        at = strstr(at + 1, "\"pulses\": ");
        assert_non_null(at);
        assert_true(fabs(number_of(at, "pulses") / (50000.0 * (i + 1)) - 1.0) < 0.05); /* of whole lines */
        assert_true(number_of(at, "rounds") >= 9.0);
        const char *ns = strstr(at, "\"ns_per_pulse\": {");
        assert_non_null(ns);
        /* A median of ratios lies near the ratio of medians, within half even where other programs run. */
        const double sum_ns = number_of(ns, "build") + number_of(ns, "cast");
        assert_true(fabs(number_of(at, "cast_ratio") * sum_ns / number_of(ns, "embree") - 1.0) < 0.5);
        for (size_t k = 0; k < sizeof parts / sizeof parts[0]; k++)
            assert_true(number_of(at, parts[k]) > 0.0);
        assert_true(number_of(at, "different") == 0.0);
    }
    free(text);
}

/* The output goes to a file, with a table for people beside it. Building the meshes takes longer than the rays. */
static void test_leaks(void **state)
{
    struct wire *wire = *state;
    char json[352];
    snprintf(json, sizeof json, "%s", wire_path(wire, "bench.json"));
    const char *const args[] = {"--leaks", "40000", "-o", json, NULL};
    assert_int_equal(bench(wire, args), 0);
    char *text = wire_read(json, NULL), *table = wire_read(wire_path(wire, "out"), NULL);
    char *at = strstr(text, "\"leaks\": [");
    assert_int_equal(text[0], '{');
    assert_non_null(strstr(table, "box in box"));
    free(table);
    assert_non_null(at);
    double plain_leaks = 0.0;
    for (int i = 0; i < 4; i++) {
        at = strstr(at + 1, "\"mesh\": ");
        assert_non_null(at);
        assert_true(number_of(at, "rays") == 10000.0);
        assert_true(number_of(at, "leaks") == 0.0);
        plain_leaks += number_of(at, "plain_leaks");
    }
    assert_true(plain_leaks > 0.0); /* else the rays are not aimed well enough to show anything */
    free(text);
}

static void test_wrong_usage(void **state)
{
    static const char *const wrong[][4] = {
        {"--scenes", "10q", NULL},    {"--scenes", "", NULL},     {"--scenes", "10k,,1M", NULL},
        {"--scenes", "-10k", NULL},   {"--scenes", "200M", NULL}, {"--threads", "0", NULL},
        {"--seconds", "nan", NULL},   {"--leaks", "-1", NULL},    {"--pulses", "12", NULL},
        {"--pulses", "1M,,1M", NULL}, {"something", NULL, NULL},  {"--what", NULL, NULL}};
    struct wire *wire = *state;
    for (size_t i = 0; i < sizeof wrong / sizeof wrong[0]; i++) {
        assert_int_equal(bench(wire, wrong[i]), 2);
        char *text = wire_read(wire_path(wire, "err"), NULL);
        assert_ptr_equal(strchr(text, '\n'), text + strlen(text) - 1); /* one line */
        assert_int_equal(strncmp(text, "bench: ", 7), 0);
        free(text);
    }
    static const char *const absent[] = {"--scenes", "house", "--house", "/nonexistent.ifc", NULL};
    assert_int_equal(bench(wire, absent), 2);
}

int main(void)
{
    static const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(test_keys, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_sight, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_leaks, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_wrong_usage, wire_setup, wire_teardown),
    };
    cmocka_set_message_output(CM_OUTPUT_TAP);
    return cmocka_run_group_tests(tests, NULL, NULL);
}
