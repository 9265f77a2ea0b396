/* SPDX-License-Identifier: MIT */
/* Files have limits of bytes, depth and digits. Errors name lines, also of what is missing. */
#include "firmware_sim/config/load.h"
#include "firmware_sim/config/table/value.h"
#include "tests/unit/config_rig.h"

enum { MOST_BYTES = 1048576, MOST_LEVELS = 16, MOST_DIGITS = 20 };

static void expect_text(const char *after_path)
{
    char want[1200];
    snprintf(want, sizeof want, "%s%s", config_path, after_path);
    assert_string_equal(err.text, want);
    assert_int_equal(err.code, SH_EINPUT);
}

static void a_file_has_up_to_a_mebibyte(void **state)
{
    (void)state;
    char *text = malloc(MOST_BYTES + 2);
    assert_non_null(text);
    memset(text, '#', MOST_BYTES + 1);
    memcpy(text, base, strlen(base));
    text[MOST_BYTES] = '\0';
    assert_loads(load_text(text));
    text[MOST_BYTES] = '#';
    text[MOST_BYTES + 1] = '\0';
    assert_int_equal(load_text(text), SH_EINPUT);
    expect_text(": larger than 1 MiB; allowed up to 1048576 bytes");
    free(text);
}

/* The mapping of the file is the first level. */
static void a_file_has_up_to_16_levels(void **state)
{
    (void)state;
    char text[128];
    for (int levels = MOST_LEVELS; levels <= MOST_LEVELS + 1; levels++) {
        int n = snprintf(text, sizeof text, "# a\n\nheads: ");
        for (int i = 1; i < levels; i++)
            text[n++] = '[';
        for (int i = 1; i < levels; i++)
            text[n++] = ']';
        strcpy(text + n, "\n");
        assert_int_equal(load_text(text), SH_EINPUT);
        if (levels > MOST_LEVELS)
            expect_text(":3: nested too deep; allowed 16 levels");
        else
            assert_says(":3: heads: unknown key, did you mean head? allowed head, ");
    }
}

/* Zeros at the beginning and the end are no digits. */
static void a_number_has_up_to_20_digits(void **state)
{
    (void)state;
    char text[64];
    __int128 value;
    snprintf(text, sizeof text, "0.%0*d", MOST_DIGITS + 5, 7);
    assert_null(cfg_parse_decimal(text, MOST_DIGITS + 5, &value));
    assert_true(value == 7);
    memset(text, '0', sizeof text);
    memcpy(text, "1.", 2);
    text[sizeof text - 1] = '\0';
    assert_null(cfg_parse_decimal(text, 0, &value));
    assert_true(value == 1);
    assert_null(cfg_parse_decimal("99999999999999999999", 0, &value));
    assert_true(value == (__int128)UINT64_C(9999999999999999999) * 10 + 9);
    assert_string_equal(cfg_parse_decimal("100000000000000000000", 0, &value), "out of range");
    assert_null(cfg_parse_decimal("-1e19", 0, &value));
    assert_true(value < 0);
    assert_string_equal(cfg_parse_decimal("1e20", 0, &value), "out of range");
    assert_string_equal(cfg_parse_decimal("1.5", 0, &value), "not a whole number");
    assert_null(cfg_parse_decimal("15e-1", 1, &value));
    assert_true(value == 15);
}

/* An error hints at tabs only where the line has one before its text. */
static void a_tab_in_the_indent_is_named(void **state)
{
    (void)state;
    static const struct {
        const char *text;
        int line, hint;
    } cases[] = {
        {"head:\n\tprofile: a\n", 2, 1},
        {"head:\n  \tprofile: a\n", 2, 1},
        {"head: {\n  profile: a]\n\t\n", 2, 0},
        {"head:\n  profile: [a\tb\nlinks: }\n", 3, 0},
        {"\tlinks: []\n", 1, 1},
    };
    static const char hint[] = "; indent with spaces, not with tabs";
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        char start[200];
        assert_int_equal(load_text(cases[i].text), SH_EINPUT);
        snprintf(start, sizeof start, "%s:%d: not YAML: ", config_path, cases[i].line);
        if (strncmp(err.text, start, strlen(start)) != 0) fail_msg("case %zu: %s", i, err.text);
        const size_t len = strlen(err.text), n = strlen(hint);
        if ((len > n && strcmp(err.text + len - n, hint) == 0) != cases[i].hint) fail_msg("case %zu: %s", i, err.text);
        assert_int_equal(diagnostics.n, 1);
    }
    const char *const sets[] = {"links=[\t}"};
    write_file(config_path, base, strlen(base));
    assert_int_equal(load_sets(sets, 1), SH_EINPUT);
    assert_null(strstr(err.text, "indent with spaces"));
}

static void bytes_that_are_no_text_have_their_line(void **state)
{
    (void)state;
    static const char ending[] = "; allowed UTF-8 text without control characters";
    static const struct {
        const char *text;
        int line;
    } cases[] = {{"head: {}\n\n# \xff\n", 3}, {"\x01\n", 1}, {"head: {}\nlinks:\n  - {\n\x7f}\n", 4}};
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        char start[200];
        assert_int_equal(load_text(cases[i].text), SH_EINPUT);
        snprintf(start, sizeof start, "%s:%d: not YAML: ", config_path, cases[i].line);
        if (strncmp(err.text, start, strlen(start)) != 0) fail_msg("case %zu: %s", i, err.text);
        assert_string_equal(err.text + strlen(err.text) - strlen(ending), ending);
    }
}

/* The error of a missing key names the line of the map around it; at the top, the line of the first key. */
static void what_is_missing_has_a_line(void **state)
{
    (void)state;
    static const char text[] = "# none\n\n" /* 1 */
                               "head: {profile: any-rate}\n"
                               "scene:\n"
                               "  meshes:\n" /* 5 */
                               "    - file: cube.obj\n"
                               "      scale: 1\n"
                               "    - up: z\n"
                               "      scale: 1\n"
                               "links:\n"      /* 10 */
                               "  - port: 0\n" /* 11 */
                               "  -\n"
                               "    {}\n";
    static const char *const starts[] = {":3: stations: missing", ":6: scene.meshes[0].up: missing",
                                         ":8: scene.meshes[1].file: missing", ":11: links[0].type: missing",
                                         ":13: links[1].type: missing"};
    assert_int_equal(load_text(text), SH_EINPUT);
    assert_int_equal(diagnostics.n, 5);
    for (size_t i = 0; i < 5; i++) {
        char want[200];
        snprintf(want, sizeof want, "%s%s, and it has no default; ", config_path, starts[i]);
        if (strncmp(diagnostics.err[i].text, want, strlen(want)) != 0)
            fail_msg("\"%s\", expected \"%s\"", diagnostics.err[i].text, want);
    }
}

/* A key that is unknown, given twice or no word has its own line, and a value has its own. */
static void keys_and_values_have_their_lines(void **state)
{
    (void)state;
    static const struct {
        const char *old, *with, *text;
    } cases[] = {
        {PRR, "  prr_hz:\n    5 kHz\n", ":4: head.prr_hz: \"5 kHz\" is not a number; allowed 100000 to 1200000 Hz"},
        {PRR, "  ? {a: b}\n  : 5\n", ":3: head: a key that is a section with keys; allowed words only"},
        {PRR, "  ? [a]\n  : 5\n", ":3: head: a key that is a list; allowed words only"},
        {"links:", "? [a]\n: 5\nlinks:", ":13: configuration: a key that is a list; allowed words only"},
        {"[1, 2, 3]", "[1,\n    2,\n    x]",
         ":13: stations[0].position_m: \"x\" is not a number; allowed [x, y, z], each -1000000000 to 1000000000 m"},
        {"[1, 2, 3]", "[1,\n    2]",
         ":11: stations[0].position_m: has 2 numbers instead of 3; allowed [x, y, z], each -1000000000 to 1000000000 m"},
        {PRR, "  prr_hz: !!int 500000\n",
         ":3: head.prr_hz: \"500000\" is a value with a tag, which is not supported; allowed 100000 to 1200000 Hz"},
        {PRR, "  prr_hz: |\n    500000\n",
         ":3: head.prr_hz: \"500000?\" is a text in quotes or of several lines; allowed 100000 to 1200000 Hz"},
        {PRR, "  prr_hz: ''\n",
         ":3: head.prr_hz: \"\" is a text in quotes or of several lines; allowed 100000 to 1200000 Hz"},
        {"  - type: tcp\n", "  - type: !x tcp\n",
         ":14: links[0].type: \"tcp\" is a value with a tag, which is not supported; allowed null, file, pty, tcp, usb, "
         "udp, web"},
        {"[1, 2, 3]", "!y [1, 2, 3]", ":11: stations[0].position_m: has a tag; allowed none"},
    };
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        if (load_edited(cases[i].old, cases[i].with) != SH_EINPUT) fail_msg("%s is taken", cases[i].with);
        expect_text(cases[i].text);
        assert_int_equal(diagnostics.n, 1);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_file_has_up_to_a_mebibyte),
        cmocka_unit_test(a_file_has_up_to_16_levels),
        cmocka_unit_test(a_number_has_up_to_20_digits),
        cmocka_unit_test(a_tab_in_the_indent_is_named),
        cmocka_unit_test(bytes_that_are_no_text_have_their_line),
        cmocka_unit_test(what_is_missing_has_a_line),
        cmocka_unit_test(keys_and_values_have_their_lines),
    };
    return cmocka_run_group_tests_name("files at their limits", tests, set_up, tear_down);
}
