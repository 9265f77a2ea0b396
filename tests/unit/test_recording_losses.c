/* SPDX-License-Identifier: MIT */
/* A recording goes on where the end of a scan was lost, or the telemetry with its final counts. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include "tests/unit/recording_steps_rig.h"

static void expect(const char *expected)
{
    assert_string_equal(trace, expected);
}

/* After 2 s without pulses, it asks for the state where frames were lost: the end may be among them. */
static void a_lost_end(void **state)
{
    static const struct turn script[] = {POINTS(0, 1), NOTHING(1999), NOTHING(1), OVER(0), LAST};
    (void)state;
    turns = script;
    run_it(SH_OK);
    expect("HEAD:STAT?@0 prepare0@0 SCAN:STAR@0 second@1999 ");
    make_recording(NULL);
    turns = script;
    stats.dropped = 1;
    run_it(SH_OK);
    expect("HEAD:STAT?@0 prepare0@0 SCAN:STAR@0 second@1999 HEAD:STAT?@2000 count_end ");
    assert_string_equal(warned, "the scan's end was lost; the head is idle\n");
    const struct turn news[] = {POINTS(0, 1), {.frame = {.type = SCANHEAD_TELEMETRY}}, LAST};
    make_recording(NULL);
    turns = news;
    stats.restarts = 1;
    run_it(SH_OK);
    assert_string_equal(warned, "the scan's end was lost; the head goes on without it\n");
}

/* If the final counts of a scan were lost, the next telemetry has them. It gets 2 s, and neither a signal nor the end
 * of the stream is delayed by the wait, or made a failure. */
static void counts_that_are_due(void **state)
{
    static const struct turn comes[] = {POINTS(100, 1),
                                        OVER(0),
                                        NOTHING(900),
                                        {.frame = {.type = SCANHEAD_TELEMETRY}},
                                        LAST},
                             lost[] = {POINTS(100, 1), OVER(0), LAST},
                             ends[] = {POINTS(100, 1), OVER(0), {.rc = SCANHEAD_ECLOSED, .ms = 100}, LAST},
                             full[] = {POINTS(100, 1), OVER(0), {.frame = {.flags = 99}}, LAST};
    static const struct {
        const struct turn *script;
        int listen, stop_ms, rc, took_ms;
    } rows[] = {{comes, 0, 0, SH_OK, 1000}, {lost, 0, 0, SH_OK, 2100}, {lost, 0, 300, SH_OK, 350},
                {ends, 0, 0, SH_OK, 200},   {full, 0, 0, SH_EIO, 100}, {ends, 1, 0, SH_OK, 200}};
    (void)state;
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        make_recording(NULL);
        options.second = NULL;
        is_count_due = 1;
        turns = rows[i].script;
        options.listen = rows[i].listen;
        stop_ms = rows[i].stop_ms;
        run_it(rows[i].rc);
        assert_true(fabs(result.wall_s - 1e-3 * rows[i].took_ms) < 1e-6);
        assert_int_equal(result.counts.scans, 1);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test_setup(a_lost_end, make_recording),
                                       cmocka_unit_test_setup(counts_that_are_due, make_recording)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
