/* SPDX-License-Identifier: MIT */
/* The parts of a command line are called by themselves: splitting, fields, patterns, decimal numbers, what errors
 * quote. */
#include "firmware_sim/command/decimal.h"
#include "firmware_sim/command/parse.h"
#include "firmware_sim/command/step.h"
#include "tests/unit/command_device.h"

#include <math.h>

/* ---- a line */

static void expect_split(const char *line, const char *header, int query, const char *param)
{
    struct command_request req;
    const char *why = NULL;
    assert_int_equal(command_split(line, &req, &why), CMD_E_NONE);
    assert_null(why);
    assert_int_equal(req.header_len, strlen(header));
    assert_int_equal(strncmp(req.header, header, req.header_len), 0);
    assert_int_equal(req.query, query);
    assert_string_equal(req.param, param);
}

static void expect_no_split(const char *line, int error, const char *text)
{
    struct command_request req;
    const char *why = NULL;
    assert_int_equal(command_split(line, &req, &why), error);
    assert_string_equal(why, text);
}

static void a_line_has_header_and_parameter(void **state)
{
    (void)state;
    expect_split("HEAD:PRR 5", "HEAD:PRR", 0, "5");
    expect_split(" \t:HEAD:PRR?\t MAX \t", "HEAD:PRR", 1, "MAX");
    expect_split("*IDN?", "*IDN", 1, "");
    expect_split("a_1 b  c", "a_1", 0, "b  c");
    expect_split("", "", 0, "");
    expect_split(" \t ", "", 0, "");
    expect_no_split("HEAD;", CMD_E_SYNTAX, "one command per line, no ';'");
    expect_no_split("HEAD:PRR=5", CMD_E_SYNTAX, "a blank must follow the header");
    expect_no_split("HEAD:PRR??", CMD_E_SYNTAX, "a blank must follow the header");
    expect_no_split("*IDN*", CMD_E_SYNTAX, "a blank must follow the header");
    expect_no_split("?", CMD_E_SYNTAX, "a command begins with a letter, ':' or '*'");
    expect_no_split("-5", CMD_E_SYNTAX, "a command begins with a letter, ':' or '*'");
}

static void a_line_has_up_to_256_characters(void **state)
{
    (void)state;
    struct command_request req;
    const char *why = NULL;
    char line[COMMAND_MAX_LINE + 2];
    memset(line, 'x', sizeof line - 1);
    line[COMMAND_MAX_LINE] = '\0';
    assert_int_equal(command_split(line, &req, &why), CMD_E_NONE);
    assert_int_equal(req.header_len, 256);
    line[COMMAND_MAX_LINE] = 'x';
    line[COMMAND_MAX_LINE + 1] = '\0';
    expect_no_split(line, CMD_E_OVERRUN, "the line is longer than 256 characters");
}

static void expect_field(const char *text, const char *want, size_t want_len, const char *want_rest)
{
    char field[COMMAND_FIELD_LEN];
    size_t len;
    const char *rest = command_take_field(text, field, &len);
    assert_string_equal(field, want);
    assert_int_equal(len, want_len);
    if (want_rest == NULL)
        assert_null(rest);
    else
        assert_string_equal(rest, want_rest);
}

static void fields_are_between_commas(void **state)
{
    (void)state;
    char text[80], cut[COMMAND_FIELD_LEN];
    expect_field(" \ta b\t ,c", "a b", 3, "c");
    expect_field("c", "c", 1, NULL);
    expect_field("", "", 0, NULL);
    expect_field(" , x", "", 0, " x");
    expect_field(",", "", 0, "");
    memset(text, 'y', sizeof text);
    text[63] = '\0';
    expect_field(text, text, 63, NULL);
    text[63] = 'y';
    strcpy(text + 64, ",z");
    snprintf(cut, sizeof cut, "%.63s", text);
    expect_field(text, cut, 64, "z"); /* its length says that it is cut */
}

/* ---- patterns: SCPI-99 6.2.1 */

static int matches(const char *pattern, const char *header)
{
    return command_header_matches(pattern, header, strlen(header));
}

static void headers_match_short_and_long(void **state)
{
    (void)state;
    static const char pattern[] = "SYSTem:ERRor[:NEXT]";
    static const char *const its[] = {"SYST:ERR", "system:error", "SYSTem:ERR:NEXT", "Syst:Error:next"};
    static const char *const others[] = {
        "SYST",          "SYST:ERR:", "SYST:ERR:NEX", "SYSTE:ERR", "SYS:ERR", "SYST:ERR:NEXT:",    "SYST:ERR:COUN",
        "SYSTem:ERRors", "",          ":SYST:ERR",    "SYST::ERR", "ERR",     "SYST:ERR:NEXT:NEXT"};
    for (size_t i = 0; i < N_OF(its); i++)
        if (!matches(pattern, its[i])) fail_msg("%s", its[i]);
    for (size_t i = 0; i < N_OF(others); i++)
        if (matches(pattern, others[i])) fail_msg("%s", others[i]);
    assert_true(matches("A[:B]:C", "a:b:c") && matches("A[:B]:C", "a:c") && !matches("A[:B]:C", "a:b"));
    assert_true(command_header_matches("HEAD:PRR", "HEAD:PRRX", 8)); /* only this much of the text */
    assert_true(command_word_matches("MINimum", "min") && command_word_matches("MINimum", "Minimum"));
    assert_false(command_word_matches("MINimum", "mini") || command_word_matches("MINimum", "minimums"));
    assert_false(command_word_matches("MINimum", "") || command_word_matches("MINimum", "MAX"));
}

/* ---- numbers */

static void expect_decimal(const char *text, const char *digits, int exponent, int negative, const char *rest)
{
    struct command_decimal d;
    const char *end = command_parse_decimal(text, &d);
    if (end == NULL) fail_msg("%s is no number", text);
    assert_string_equal(end, rest);
    assert_int_equal(d.n_digits, strlen(digits));
    assert_memory_equal(d.digits, digits, strlen(digits));
    if (digits[0] != '\0') assert_int_equal(d.exponent, exponent);
    assert_int_equal(d.negative, negative);
}

static void numbers_are_read_exactly(void **state)
{
    (void)state;
    static const char *const none[] = {"", "-", "+", ".", "e5", "x", " 5", "-.", "--5", "+-5"};
    struct command_decimal d;
    expect_decimal("5", "5", 0, 0, "");
    expect_decimal("-0012.3400", "1234", -2, 1, "");
    expect_decimal("+120000", "12", 4, 0, "");
    expect_decimal(".5", "5", -1, 0, "");
    expect_decimal("5.", "5", 0, 0, "");
    expect_decimal("0.000", "", 0, 0, "");
    expect_decimal("1.5.5", "15", -1, 0, ".5");
    expect_decimal("5 KHZ", "5", 0, 0, "KHZ");
    expect_decimal("1 E\t-3 m", "1", -3, 0, "m");
    expect_decimal("1e+2", "1", 2, 0, "");
    expect_decimal("1e", "1", 0, 0, "e"); /* a unit, if anything */
    expect_decimal("1 e+x", "1", 0, 0, "e+x");
    expect_decimal("1e31999", "1", 31999, 0, "");
    expect_decimal("1e320000", "1", 32000, 0, ""); /* further digits are passed over */
    expect_decimal("1e-320000x", "1", -32000, 0, "x");
    for (size_t i = 0; i < N_OF(none); i++)
        if (command_parse_decimal(none[i], &d) != NULL) fail_msg("'%s' is a number", none[i]);
}

/* Zeros at the beginning are no digits, so more of them fit. */
static void a_number_has_as_many_digits_as_a_line(void **state)
{
    (void)state;
    struct command_decimal d;
    char text[2 * COMMAND_MAX_LINE];
    memset(text, '0', sizeof text);
    memset(text + 10, '7', COMMAND_MAX_LINE);
    text[10 + COMMAND_MAX_LINE] = '\0';
    assert_non_null(command_parse_decimal(text, &d));
    assert_int_equal(d.n_digits, COMMAND_MAX_LINE);
    strcpy(text + 10 + COMMAND_MAX_LINE, "7");
    assert_null(command_parse_decimal(text, &d));
}

static void expect_int(const char *text, int shift, enum command_fit fit, int64_t want)
{
    struct command_decimal d;
    int64_t value = 1;
    assert_non_null(command_parse_decimal(text, &d));
    const enum command_fit got = command_decimal_to_int(&d, shift, &value);
    if (got != fit || (fit == COMMAND_FIT_EXACT && value != want))
        fail_msg("%s: %d, %lld", text, got, (long long)value);
}

static void whole_numbers_fit_63_bits(void **state)
{
    (void)state;
    expect_int("1.5", 6, COMMAND_FIT_EXACT, 1500000);
    expect_int("1.5", 1, COMMAND_FIT_EXACT, 15);
    expect_int("1.5", 0, COMMAND_FIT_FINE, 0);
    expect_int("-2e3", -3, COMMAND_FIT_EXACT, -2);
    expect_int("-2e3", -4, COMMAND_FIT_FINE, 0);
    expect_int("0", -9, COMMAND_FIT_EXACT, 0);
    expect_int("9223372036854775807", 0, COMMAND_FIT_EXACT, INT64_MAX);
    expect_int("-9223372036854775807", 0, COMMAND_FIT_EXACT, -INT64_MAX);
    expect_int("9223372036854775808", 0, COMMAND_FIT_BIG, 0);
    expect_int("9999999999999999999", 0, COMMAND_FIT_BIG, 0); /* 19 digits, more than 63 bits */
    expect_int("1e18", 0, COMMAND_FIT_EXACT, INT64_C(1000000000000000000));
    expect_int("1e19", 0, COMMAND_FIT_BIG, 0);
    expect_int("1e32000", 9, COMMAND_FIT_BIG, 0);
}

static void a_double_is_the_nearest(void **state)
{
    (void)state;
    static const struct {
        const char *text;
        double value;
    } is[] = {{"0", 0.0},         {"-0.1", -0.1},
              {"1 E2", 1e2},      {"123456789.125", 123456789.125},
              {"5e-324", 5e-324}, {"1e400", (double)INFINITY},
              {"-25e-1", -2.5}};
    for (size_t i = 0; i < N_OF(is); i++) {
        struct command_decimal d;
        assert_non_null(command_parse_decimal(is[i].text, &d));
        if (command_decimal_to_double(&d) != is[i].value) fail_msg("%s", is[i].text);
    }
}

static void a_fixed_number_has_no_zeros_at_its_end(void **state)
{
    (void)state;
    static const struct {
        int64_t value;
        int decimals;
        const char *text;
    } is[] = {{300000000000, 6, "300000"},
              {-500000, 6, "-0.5"},
              {1, 6, "0.000001"},
              {0, 6, "0"},
              {-7, 0, "-7"},
              {10, 0, "10"},
              {1200, 3, "1.2"},
              {1020, 3, "1.02"},
              {999999, 6, "0.999999"},
              {INT64_MIN, 9, "-9223372036.854775808"}};
    char text[32];
    for (size_t i = 0; i < N_OF(is); i++) {
        command_format_fixed(text, sizeof text, is[i].value, is[i].decimals);
        assert_string_equal(text, is[i].text);
    }
}

/* An error quotes up to 35 characters. */
static void what_is_quoted_is_cut(void **state)
{
    (void)state;
    static const char text[] = "abcdefghijklmnopqrstuvwxyz0123456789";
    char clip[COMMAND_CLIP_LEN];
    command_clip(clip, text, 35);
    assert_string_equal(clip, "abcdefghijklmnopqrstuvwxyz012345678");
    command_clip(clip, text, 36);
    assert_string_equal(clip, "abcdefghijklmnopqrstuvwxyz012345...");
    command_clip(clip, text, 0);
    assert_string_equal(clip, "");
    /* It is cut between two characters: the euro sign, of three bytes, begins at 30, 31 or 32. */
    static const char *const last[] = {"\xe2\x82\xac.....", ".\xe2\x82\xac....", "..\xe2\x82\xac..."};
    for (int i = 0; i < 3; i++) {
        char quoted[40], want[40];
        snprintf(quoted, sizeof quoted, "%.30s%s", text, last[i]);
        snprintf(want, sizeof want, "%.30s%.*s...", text, i, "..");
        command_clip(clip, quoted, strlen(quoted));
        assert_string_equal(clip, want);
    }
}

/* ---- the head */

static void steps_of_a_turn(void **state)
{
    (void)state;
    struct head_limits limits = {.line_pulses = 7};
    struct head_settings settings = {.step_udeg = 0};
    assert_int_equal(command_step_ndeg(720), 500000000);
    assert_int_equal(command_step_ndeg(7), 51428571429);  /* the nearest to 360e9 / 7 = 51428571428.57 */
    assert_int_equal(command_step_ndeg(13), 27692307692); /* ...692.3 */
    assert_int_equal(head_step_udeg(720), 500000);
    assert_int_equal(head_step_udeg(7), 51428571);
    assert_int_equal(head_line_pulses(&limits, &settings), 7);
    settings.step_udeg = 500000;
    assert_int_equal(head_line_pulses(&limits, &settings), 720);
}

static void stations_with_another_scanner_have_a_bit(void **state)
{
    (void)state;
    const struct head_limits limits = {.elsewhere = 1 | 4 | UINT64_C(1) << 63};
    assert_true(head_is_elsewhere(&limits, 1) && head_is_elsewhere(&limits, 3) && head_is_elsewhere(&limits, 64));
    assert_false(head_is_elsewhere(&limits, 2) || head_is_elsewhere(&limits, 63) || head_is_elsewhere(&limits, 0));
    assert_false(head_is_elsewhere(&limits, 65) || head_is_elsewhere(&limits, -1));
}

static void peers_have_the_numbers_of_their_sessions(void **state)
{
    (void)state;
    struct command_device dev = command_test_device();
    command_set_peer(&dev, 1, "tcp a");
    command_set_peer(&dev, COMMAND_PEERS - 1, "tcp b");
    command_set_peer(&dev, 0, "tcp c"); /* the device itself */
    command_set_peer(&dev, COMMAND_PEERS, "tcp d");
    assert_string_equal(command_peer(&dev, 1), "tcp a");
    assert_string_equal(command_peer(&dev, COMMAND_PEERS - 1), "tcp b");
    assert_string_equal(command_peer(&dev, 0), "");
    assert_string_equal(command_peer(&dev, COMMAND_PEERS), "");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_line_has_header_and_parameter),
        cmocka_unit_test(a_line_has_up_to_256_characters),
        cmocka_unit_test(fields_are_between_commas),
        cmocka_unit_test(headers_match_short_and_long),
        cmocka_unit_test(numbers_are_read_exactly),
        cmocka_unit_test(a_number_has_as_many_digits_as_a_line),
        cmocka_unit_test(whole_numbers_fit_63_bits),
        cmocka_unit_test(a_double_is_the_nearest),
        cmocka_unit_test(a_fixed_number_has_no_zeros_at_its_end),
        cmocka_unit_test(what_is_quoted_is_cut),
        cmocka_unit_test(steps_of_a_turn),
        cmocka_unit_test(stations_with_another_scanner_have_a_bit),
        cmocka_unit_test(peers_have_the_numbers_of_their_sessions),
    };
    return cmocka_run_group_tests_name("parts of a command", tests, NULL, NULL);
}
