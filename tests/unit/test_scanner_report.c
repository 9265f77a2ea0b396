/* SPDX-License-Identifier: MIT */
/* Warnings of several scanners: one for each text, with the stations whose scanners gave it. */
#include "firmware_sim/app/scanner_report.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

static char warned[4096]; /* a line each */
static double progressed;
static int stops;

static void keep(void *ctx, const char *text)
{
    (void)ctx;
    const size_t used = strlen(warned);
    snprintf(warned + used, sizeof warned - used, "%s\n", text);
}

static void note_progress(void *ctx, const char *what, double fraction)
{
    (void)ctx;
    assert_string_equal(what, "loading");
    progressed = fraction;
}

static int is_to_stop(void *ctx)
{
    (void)ctx;
    return stops;
}

static const struct sh_report to = {.warn = keep, .progress = note_progress, .stop = is_to_stop};
static struct scanner_report report[3];
static struct scanner_warnings warnings;

static int begin(void **state)
{
    (void)state;
    warned[0] = '\0';
    memset(&warnings, 0, sizeof warnings);
    static const uint32_t stations[] = {1, 3, CONFIG_MAX_STATIONS};
    for (int i = 0; i < 3; i++)
        scanner_report_set_up(&report[i], &to, stations[i], &warnings);
    return 0;
}

static int end(void **state)
{
    (void)state;
    scanner_warnings_free(&warnings);
    assert_int_equal(warnings.n, 0);
    return 0;
}

static void warn(int i, const char *text)
{
    sh_warn(&report[i].report, "%s", text);
}

static void each_text_is_printed_once_with_its_stations(void **state)
{
    (void)state;
    warn(0, "both");
    warn(1, "one");
    warn(2, "both");
    warn(2, "both");
    assert_string_equal(warned, "");
    scanner_warnings_say(&warnings, NULL, &to);
    assert_string_equal(warned, "scanners of stations 1, 64: both\nscanner of station 3: one\n");
    scanner_warnings_say(&warnings, NULL, &to); /* they were said */
    warn(0, "one");
    assert_string_equal(warned, "scanners of stations 1, 64: both\nscanner of station 3: one\n");
    warn(1, "new");
    assert_non_null(strstr(warned, "one\nscanner of station 3: new\n"));
}

/* The first scanner's warnings were printed when it was loaded. Where all have the same one, that was enough. */
static void warnings_of_the_first_are_not_said_again(void **state)
{
    (void)state;
    struct site *first = calloc(1, sizeof *first);
    assert_non_null(first);
    first->warnings.text[0] = strdup("all");
    first->warnings.text[1] = strdup("some");
    first->warnings.n = 2;
    for (int i = 0; i < 3; i++)
        warn(i, "all");
    warn(1, "some");
    warn(2, "some");
    warn(2, "last");
    scanner_warnings_say(&warnings, first, &to);
    assert_string_equal(warned, "scanners of stations 3, 64, too: some\nscanner of station 64: last\n");
    free(first->warnings.text[0]);
    free(first->warnings.text[1]);
    free(first);
}

/* A text beyond those that can be kept is printed at once. */
static void what_has_no_room_is_printed_at_once(void **state)
{
    (void)state;
    char text[32];
    for (int i = 0; i <= SITE_MAX_WARNINGS; i++) {
        assert_string_equal(warned, "");
        snprintf(text, sizeof text, "warning %d", i);
        warn(1, text);
    }
    assert_string_equal(warned, "scanner of station 3: warning 64\n");
    warn(2, "warning 63"); /* the last one that was kept */
    assert_string_equal(warned, "scanner of station 3: warning 64\n");
    assert_true(warnings.one[SITE_MAX_WARNINGS - 1].is_of[2] && warnings.one[SITE_MAX_WARNINGS - 1].is_of[63]);
}

static void all_else_is_handed_on(void **state)
{
    (void)state;
    sh_progress(&report[1].report, "loading", 0.25);
    assert_true(progressed == 0.25);
    stops = 0;
    assert_false(sh_stopped(&report[1].report));
    stops = 1;
    assert_true(sh_stopped(&report[1].report));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(each_text_is_printed_once_with_its_stations, begin, end),
        cmocka_unit_test_setup_teardown(warnings_of_the_first_are_not_said_again, begin, end),
        cmocka_unit_test_setup_teardown(what_has_no_room_is_printed_at_once, begin, end),
        cmocka_unit_test_setup_teardown(all_else_is_handed_on, begin, end),
    };
    return cmocka_run_group_tests_name("scanner report", tests, NULL, NULL);
}
