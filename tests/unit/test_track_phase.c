/* SPDX-License-Identifier: MIT */
/* Rows of lines in which settings change, compared with the head's own schedule (core/schedule.h). */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <cmocka.h>

#include "core/schedule.h"
#include "drivers/record/track_phase.h"

static const int64_t HZ = 1000000; /* micro-hertz */

/* Rates whose lines have a whole number of pulses, and others. */
static const struct {
    int64_t prr_uhz, lines_uhz;
    uint64_t pulses; /* until the next change: within a line, over several, at once */
} CHANGES[] = {
    {100000 * HZ, 10 * HZ, 14096}, {100000 * HZ, 40 * HZ, 26692}, {300000 * HZ, 40 * HZ, 42512},
    {300000 * HZ, 40 * HZ, 1},     {300000 * HZ, 17000001, 7},    {99999999999, 33333333, 123457},
    {2000 * HZ, 999 * HZ, 1},      {2000 * HZ, 3 * HZ, 1001},     {100000 * HZ, 10 * HZ, 29999},
};
enum { N_CHANGES = sizeof CHANGES / sizeof CHANGES[0] };

static struct schedule_spec spec_of(int i)
{
    return (struct schedule_spec){.prr_uhz = CHANGES[i].prr_uhz,
                                  .lines_uhz = CHANGES[i].lines_uhz,
                                  .fov_min_udeg = 30 * HZ,
                                  .sweep_udeg = 240 * HZ,
                                  .line_start_udeg = 30 * HZ,
                                  .line_stop_udeg = 130 * HZ};
}

/* Returns the row of pulse k: so many pulses of these rates lie between the line's angle 0 and the pulse. */
static uint64_t row_of(const struct schedule_segment *seg, uint64_t k)
{
    struct schedule_line line;
    schedule_get_line(seg, schedule_line_of(seg, k), &line);
    return line.r_first_pulse / seg->num + (k - line.pulse0);
}

/* Tells the phase of the lines that begin between two pulses, as the ends of lines do. */
static void tell_lines(struct track_phase *phase, const struct schedule_segment *seg, uint64_t from, uint64_t to)
{
    for (uint64_t n = schedule_line_of(seg, from) + 1; n <= schedule_line_of(seg, to); n++) {
        struct schedule_line line;
        schedule_get_line(seg, n, &line);
        track_phase_line(phase, (uint32_t)n, line.pulse0);
    }
}

static uint64_t phase_row(const struct track_phase *phase, const struct schedule_segment *seg, uint64_t k)
{
    uint64_t row = UINT64_MAX;
    assert_int_equal(track_phase_row(phase, (uint32_t)schedule_line_of(seg, k), k, &row), 1);
    return row;
}

/* Both follow the changes from `first` on; the phase knows of the scan from there on. Returns the largest difference of
 * rows at a change. */
static uint64_t follow(int first)
{
    struct schedule_segment seg;
    struct track_phase phase = {0};
    uint64_t k = 0, worst = 0;
    for (int i = 0; i < N_CHANGES; i++) {
        const struct schedule_spec spec = spec_of(i);
        if (i == 0)
            schedule_start(&seg, &spec);
        else
            schedule_change(&seg, &seg, &spec, k);
        if (i == first) track_phase_start(&phase, (uint64_t)spec.prr_uhz, (uint64_t)spec.lines_uhz);
        if (i > first) {
            track_phase_change(&phase, k, (uint64_t)spec.prr_uhz, (uint64_t)spec.lines_uhz);
            const uint64_t row = phase_row(&phase, &seg, k), want = row_of(&seg, k);
            const uint64_t apart = row > want ? row - want : want - row;
            if (apart > worst) worst = apart;
        }
        if (i >= first) tell_lines(&phase, &seg, k, k + CHANGES[i].pulses);
        k += CHANGES[i].pulses;
    }
    return worst;
}

static void rows_are_those_of_the_schedule(void **state)
{
    (void)state;
    assert_int_equal(follow(0), 0);
}

/* Settings had changed before the recording began. The first line that begins then says where the sweep is, to a pulse
 * of the rates at that time: with 3 lines a second and then 10 that is 10 / 3 * 100000 / 2000 rows at most. */
static void a_stream_that_is_joined(void **state)
{
    (void)state;
    assert_true(follow(7) <= 167);
    assert_true(follow(1) <= 1); /* 40 lines a second after 10, then as many lines with more pulses: 3 rows a pulse */
}

static void rates_that_are_not_known(void **state)
{
    (void)state;
    struct track_phase phase;
    uint64_t row;
    track_phase_start(&phase, 1000, 0);
    track_phase_line(&phase, 1, 100);
    assert_int_equal(track_phase_row(&phase, 1, 100, &row), 0);
    track_phase_change(&phase, 50, 0, 7);
    assert_int_equal(track_phase_row(&phase, 0, 50, &row), 0);
    track_phase_change(&phase, 60, 1000, 10);
    assert_int_equal(track_phase_row(&phase, 0, 70, &row), 0); /* as if they had not changed */
    track_phase_change(&phase, 70, 1000, 20);
    assert_int_equal(track_phase_row(&phase, 1, 75, &row), 0); /* another line */
    assert_int_equal(track_phase_row(&phase, 0, 75, &row), 1);
    assert_int_equal(row, 40); /* 0.7 of 50 rows, and 5 more */
    track_phase_restart(&phase);
    assert_int_equal(track_phase_row(&phase, 0, 75, &row), 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(rows_are_those_of_the_schedule),
        cmocka_unit_test(a_stream_that_is_joined),
        cmocka_unit_test(rates_that_are_not_known),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
