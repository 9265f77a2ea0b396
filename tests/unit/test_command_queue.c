/* SPDX-License-Identifier: MIT */
/* These are tests of the error queue and of the collector of lines. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>

#include <cmocka.h>

#include "firmware_sim/command/command.h"

static void expect_pop(struct command_queue *queue, const char *text)
{
    char buf[COMMAND_MAX_REPLY];
    command_queue_pop(queue, buf, sizeof buf);
    assert_string_equal(buf, text);
}

static void push_numbered(struct command_queue *queue, int from, int to)
{
    for (int i = from; i <= to; i++) {
        char text[32];
        snprintf(text, sizeof text, "n%d", i);
        command_queue_push(queue, CMD_E_RANGE, text);
    }
}

static void first_in_first_out(void **ctx)
{
    (void)ctx;
    struct command_queue queue = {.count = 0};
    expect_pop(&queue, "0,\"No error\"");
    command_queue_push(&queue, CMD_E_READER, "session 2");
    command_queue_push(&queue, CMD_E_HEADER, NULL);
    command_queue_push(&queue, CMD_E_HEADER, "");
    expect_pop(&queue, "102,\"Reader too slow; session 2\"");
    expect_pop(&queue, "-113,\"Undefined header\"");
    expect_pop(&queue, "-113,\"Undefined header\"");
    expect_pop(&queue, "0,\"No error\"");
}

/* SCPI-99 21.8.1: the last entry is replaced by -350, the oldest stay, and a read makes room at the end. */
static void overflow_replaces_the_last_and_counts(void **ctx)
{
    (void)ctx;
    struct command_queue queue = {.count = 0};
    push_numbered(&queue, 1, COMMAND_QUEUE_LEN + 3); /* n32 and three more are lost */
    assert_int_equal(queue.count, COMMAND_QUEUE_LEN);
    char expected[64];
    for (int i = 1; i < COMMAND_QUEUE_LEN; i++) {
        snprintf(expected, sizeof expected, "-222,\"Data out of range; n%d\"", i);
        expect_pop(&queue, expected);
    }
    expect_pop(&queue, "-350,\"Queue overflow; 4 errors lost\"");
    expect_pop(&queue, "0,\"No error\"");
}

static void a_full_queue_has_no_overflow_yet(void **ctx)
{
    (void)ctx;
    struct command_queue queue = {.count = 0};
    push_numbered(&queue, 1, COMMAND_QUEUE_LEN);
    for (int i = 1; i < COMMAND_QUEUE_LEN; i++)
        command_queue_pop(&queue, (char[64]){0}, 64);
    expect_pop(&queue, "-222,\"Data out of range; n32\"");
}

static void two_overflows_count_apart(void **ctx)
{
    (void)ctx;
    struct command_queue queue = {.count = 0};
    char buf[64];
    push_numbered(&queue, 1, COMMAND_QUEUE_LEN + 5);
    command_queue_pop(&queue, buf, sizeof buf);
    command_queue_pop(&queue, buf, sizeof buf);
    push_numbered(&queue, 101, 103); /* two fit; then the second is replaced */
    for (int i = 3; i < COMMAND_QUEUE_LEN; i++)
        command_queue_pop(&queue, buf, sizeof buf);
    assert_string_equal(buf, "-222,\"Data out of range; n31\"");
    expect_pop(&queue, "-350,\"Queue overflow; 6 errors lost\"");
    expect_pop(&queue, "-222,\"Data out of range; n101\"");
    expect_pop(&queue, "-350,\"Queue overflow; 2 errors lost\"");
    assert_int_equal(queue.count, 0);
}

static void texts_are_made_safe_and_cut(void **ctx)
{
    (void)ctx;
    struct command_queue queue = {.count = 0};
    command_queue_push(&queue, CMD_E_CLIENT_LOST, "a\"b\r\nc\x80");
    expect_pop(&queue, "101,\"Client lost; a'b~~c~\"");
    char huge[1000], buf[COMMAND_MAX_REPLY];
    memset(huge, 'x', sizeof huge - 1);
    huge[sizeof huge - 1] = '\0';
    command_queue_push(&queue, CMD_E_CLIENT_LOST, huge);
    command_queue_pop(&queue, buf, sizeof buf);
    assert_int_equal(strlen(buf), strlen("101,\"\"") + sizeof queue.entry[0].text - 1);
    assert_string_equal(buf + strlen(buf) - 5, "x...\""); /* a list that is cut does not end like a whole one */
    command_queue_push(&queue, CMD_E_CLIENT_LOST, NULL);
    command_queue_pop(&queue, buf, 8);
    assert_string_equal(buf, "101,\"Cl");
}

/* Standard texts of SCPI-99 21.8.9 and after. */
static void standard_texts(void **ctx)
{
    (void)ctx;
    assert_string_equal(command_error_text(0), "No error");
    assert_string_equal(command_error_text(-102), "Syntax error");
    assert_string_equal(command_error_text(-104), "Data type error");
    assert_string_equal(command_error_text(-108), "Parameter not allowed");
    assert_string_equal(command_error_text(-109), "Missing parameter");
    assert_string_equal(command_error_text(-113), "Undefined header");
    assert_string_equal(command_error_text(-131), "Invalid suffix");
    assert_string_equal(command_error_text(-203), "Command protected");
    assert_string_equal(command_error_text(-221), "Settings conflict");
    assert_string_equal(command_error_text(-222), "Data out of range");
    assert_string_equal(command_error_text(-350), "Queue overflow");
    assert_string_equal(command_error_text(-363), "Input buffer overrun");
    assert_string_equal(command_error_text(-199), "Command error");
    assert_string_equal(command_error_text(-299), "Execution error");
    assert_string_equal(command_error_text(-399), "Device-specific error");
    assert_string_equal(command_error_text(-499), "Query error");
    /* the classes at their ends, SCPI-99 21.8 */
    static const char *const classes[] = {"Command error", "Execution error", "Device-specific error", "Query error"};
    for (int k = 0; k < 4; k++) {
        assert_string_equal(command_error_text(-100 * (k + 1)), classes[k]);
        assert_string_equal(command_error_text(-100 * (k + 1) - 99), classes[k]);
    }
    static const int others[] = {9999, 1, -99, -500};
    for (int k = 0; k < 4; k++)
        assert_string_equal(command_error_text(others[k]), "Device-specific error");
}

/* Feeds the bytes and writes the results: lines as <text>, overruns as !. */
static void feed(struct command_lines *lines, const char *bytes, size_t len, char *log, size_t log_size)
{
    size_t at = 0;
    log[0] = '\0';
    for (size_t i = 0; i < len; i++) {
        const enum command_line_kind kind = command_lines_feed(lines, (unsigned char)bytes[i]);
        if (kind == COMMAND_LINE_READY)
            at += (size_t)snprintf(log + at, log_size - at, "<%s>", lines->buf);
        else if (kind == COMMAND_LINE_OVERRUN)
            at += (size_t)snprintf(log + at, log_size - at, "!%s", lines->buf);
    }
}

static void lines_end_with_lf_cr_or_both(void **ctx)
{
    (void)ctx;
    static const struct {
        const char *bytes, *lines;
        size_t len;
    } cases[] = {
        {"a\nb\rc\r\nd", "<a><b><c>", 8},
        {"\n\n", "<><>", 2},
        {"\r\r", "<><>", 2},
        {"\r\n\r\n", "<><>", 4},
        {"\n\r", "<><>", 2},
        {"\r\r\n\n", "<><><>", 4},
        {"a\tb\n", "<a b>", 4},
        {"\x01\x7f\x80\xff?\n", "<~~~~?>", 6},
        {"HEAD:PRR\0\n", "<HEAD:PRR~>", 10},
        {"no end", "", 6},
    };
    char log[256];
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        struct command_lines lines = {.len = 0};
        feed(&lines, cases[i].bytes, cases[i].len, log, sizeof log);
        assert_string_equal(log, cases[i].lines);
    }
}

static void long_lines_are_dropped_whole(void **ctx)
{
    (void)ctx;
    static const size_t lengths[] = {COMMAND_MAX_LINE - 1, COMMAND_MAX_LINE, COMMAND_MAX_LINE + 1, 5000};
    struct command_lines lines = {.len = 0};
    char bytes[5010], log[2 * COMMAND_MAX_LINE];
    for (size_t i = 0; i < 4; i++) {
        memset(bytes, 'x', lengths[i]);
        memcpy(bytes + lengths[i], "\r\nok\n", 6);
        feed(&lines, bytes, lengths[i] + 5, log, sizeof log);
        if (lengths[i] > COMMAND_MAX_LINE)
            assert_string_equal(log, "!<ok>");
        else
            assert_int_equal(strlen(log), lengths[i] + 2 + 4);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(first_in_first_out),
        cmocka_unit_test(overflow_replaces_the_last_and_counts),
        cmocka_unit_test(a_full_queue_has_no_overflow_yet),
        cmocka_unit_test(two_overflows_count_apart),
        cmocka_unit_test(texts_are_made_safe_and_cut),
        cmocka_unit_test(standard_texts),
        cmocka_unit_test(lines_end_with_lf_cr_or_both),
        cmocka_unit_test(long_lines_are_dropped_whole),
    };
    return cmocka_run_group_tests_name("command queue", tests, NULL, NULL);
}
