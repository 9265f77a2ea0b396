/* SPDX-License-Identifier: MIT */
/* The error scheme, limits rounded for messages, and arrays that grow (core/err.h, digits.h, grow.h). */
#include <stdio.h>
#include <string.h>

#include "core/digits.h"
#include "core/err.h"
#include "core/grow.h"
#include "tests/common/cases.h"

/* A text has one line, and ends where its room does. */
static void errors_have_a_code_and_a_line(void **state)
{
    (void)state;
    struct sh_err err;
    char longest[sizeof err.text + 10];
    assert_int_equal(sh_fail(&err, SH_EIO, "%s: %d", "a", 7), SH_EIO);
    assert_int_equal(err.code, SH_EIO);
    assert_string_equal(err.text, "a: 7");
    assert_int_equal(sh_fail(NULL, SH_EPERM, "nobody reads it"), SH_EPERM);
    memset(longest, 'x', sizeof longest);
    longest[sizeof longest - 1] = '\0';
    sh_fail(&err, SH_EIO, "%s", longest);
    assert_int_equal(strlen(err.text), sizeof err.text - 1);
    /* Control characters of ASCII, and of Latin-1 (two bytes in UTF-8), may be commands of a terminal. */
    static const char *const texts[][2] = {{"a\nb\r\x1f\x7f ~", "a?b??? ~"},
                                           {"\xc2\x80\xc2\x9f\xc2\xa0", "????\xc2\xa0"},
                                           {"\xc3\x80\xc2", "\xc3\x80?"},
                                           {"\xc2\n", "??"},
                                           {"\xe4\xb8\xad \xe4\xb8.", "\xe4\xb8\xad ??."}};
    for (size_t i = 0; i < sizeof texts / sizeof texts[0]; i++) {
        sh_fail(&err, SH_EIO, "%s", texts[i][0]);
        assert_string_equal(err.text, texts[i][1]);
    }
    sh_fail(&err, SH_EIO, "'%.5s'", "1234\xc3\xa9"); /* a quoted word is cut within its last character */
    assert_string_equal(err.text, "'1234?'");
}

struct seen {
    char warned[600], what[32];
    double fraction;
    int stops;
};

static void warn(void *ctx, const char *text)
{
    snprintf(((struct seen *)ctx)->warned, 600, "%s", text);
}

static void progress(void *ctx, const char *what, double fraction)
{
    struct seen *seen = ctx;
    snprintf(seen->what, sizeof seen->what, "%s", what);
    seen->fraction = fraction;
}

static int stop(void *ctx)
{
    return ((struct seen *)ctx)->stops;
}

/* Each member may be missing, and so may the report. What a report does not take goes to the one below it. */
static void reports(void **state)
{
    (void)state;
    struct seen seen = {.fraction = -2.0};
    struct sh_err err;
    const struct sh_report all = {&seen, warn, progress, stop, NULL}, none = {.ctx = &seen}, over = {.rest = &all};
    sh_warn(&all, "%d\n", 5);
    assert_string_equal(seen.warned, "5?");
    sh_progress(&all, "reading", 0.5);
    assert_string_equal(seen.what, "reading");
    assert_true(seen.fraction == 0.5 && !sh_stopped(&all) && sh_check_stop(&all, &err) == SH_OK);
    seen.stops = 1;
    assert_true(sh_stopped(&all) && !sh_stopped(&none) && !sh_stopped(NULL));
    assert_int_equal(sh_check_stop(&all, &err), SH_ESTOPPED);
    assert_int_equal(err.code, SH_ESTOPPED);
    assert_string_equal(err.text, "stopped while loading; no scan was run");
    assert_int_equal(sh_check_stop(NULL, &err), SH_OK);
    assert_true(sh_stopped(&over));
    sh_warn(&over, "below");
    assert_string_equal(seen.warned, "below");
    sh_progress(&over, "writing", 0.75);
    assert_string_equal(seen.what, "writing");
    sh_warn(&none, "x");
    sh_warn(NULL, "x");
    sh_progress(&none, "x", 1.0);
    sh_progress(NULL, "x", 1.0);
    assert_string_equal(seen.warned, "below");
    assert_string_equal(seen.what, "writing");
}

/* Limits are rounded towards the side that is allowed. A figure that already has few digits stays as it is. */
static void limits_in_messages(void **state)
{
    (void)state;
    static const struct {
        double x;
        int digits;
        double up, down;
    } is[] = {{1.234, 2, 1.3, 1.2},          {1.2, 2, 1.2, 1.2},       {0.3, 2, 0.3, 0.3},
              {99.5, 2, 100.0, 99.0},        {1000.0, 1, 1e3, 1e3},    {1001.0, 1, 2e3, 1e3},
              {1.9e-7, 1, 2e-7, 1e-7},       {0.1 + 0.2, 3, 0.3, 0.3}, {12345.6, 6, 12345.6, 12345.6},
              {12345.6, 5, 12346.0, 12345.0}};
    for (size_t i = 0; i < sizeof is / sizeof is[0]; i++) {
        assert_true(fabs(digits_up(is[i].x, is[i].digits) - is[i].up) < 1e-9 * is[i].up);
        assert_true(fabs(digits_down(is[i].x, is[i].digits) - is[i].down) < 1e-9 * is[i].down);
    }
}

/* An array keeps its elements. It has room to spare, so that it moves seldom. Asking for too much leaves it alone. */
static void arrays_grow(void **state)
{
    (void)state;
    uint32_t *array = NULL;
    size_t room = 0;
    int moves = 0;
    for (uint32_t i = 0; i < 10000; i++) {
        const size_t before = room;
        assert_true(grow(&array, &room, i + 1, sizeof *array) && room > i);
        moves += room != before;
        array[i] = i;
    }
    for (uint32_t i = 0; i < 10000; i++)
        assert_int_equal(array[i], i);
    assert_true(moves < 20 && room < 20000);
    uint32_t *const as_it_was = array;
    assert_false(resize(&array, SIZE_MAX / sizeof *array + 1, sizeof *array));
    assert_ptr_equal(array, as_it_was);
    assert_true(resize(&array, 3, sizeof *array) && array[2] == 2);
    assert_true(resize(&array, 0, sizeof *array) && array != NULL);
    free(array);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(errors_have_a_code_and_a_line),
        cmocka_unit_test(reports),
        cmocka_unit_test(limits_in_messages),
        cmocka_unit_test(arrays_grow),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
