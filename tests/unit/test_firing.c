/* SPDX-License-Identifier: MIT */
/* Schedules with a firing table, against a data sheet: firing times as fractions in 128-bit integers. */
#include "tests/unit/schedule_rig.h"

#include <math.h>
#include <string.h>

#include "core/cast/kernels_times.h"
#include "tests/common/aimed.h"

static const int64_t HOUR_NS = INT64_C(3600000000000), DAY_NS = 24 * INT64_C(3600000000000);

/* ---- a VLP-16: 16 firings 2304 ns apart, a sequence each 55296 ns */

static void vlp16(struct emitter *e)
{
    struct emitter_beam beam[16];
    for (uint32_t i = 0; i < 16; i++)
        beam[i] = (struct emitter_beam){(i % 2 == 0 ? -15 + (int64_t)i : (int64_t)i) * 1000000, 0, 2304 * i};
    assert_int_equal(emitter_set_beams(e, beam, 16, 55296000, 1, NULL), SH_OK);
}

static int64_t vlp16_ns(uint64_t k)
{
    return (int64_t)(k / 16 * 55296 + k % 16 * 2304);
}

static struct schedule_spec turning(const struct emitter *e, int64_t lines_uhz)
{
    return (struct schedule_spec){.prr_uhz = emitter_rate_uhz(e),
                                  .lines_uhz = lines_uhz,
                                  .sweep_udeg = 360000000,
                                  .line_stop_udeg = 360000000,
                                  .emitter = e};
}

static void the_rate_is_no_whole_number(void **state)
{
    (void)state;
    struct emitter e;
    vlp16(&e);
    assert_int_equal(e.tick_num, 2304);
    assert_int_equal(e.tick_den, 1);
    assert_int_equal(e.sequence_ticks, 24);
    assert_int_equal(emitter_rate_uhz(&e), 289351851852); /* 16 / 55.296 us is 289351.851 851 851... Hz */
}

/* Returns a pulse in the first hour or day, or anywhere. */
static uint64_t some_pulse(uint64_t *cases, int i)
{
    const uint64_t hour = (uint64_t)HOUR_NS / 55296 * 16;
    if (i < 100) return (uint64_t)i;
    return (uint64_t)case_between(cases, 0, (int64_t)(i % 2 == 0 ? hour : 24 * hour)) + (i % 7 == 0 ? hour - 8 : 0);
}

static void an_hour_and_a_day_are_exact(void **state)
{
    (void)state;
    uint64_t cases = 11;
    struct emitter e;
    struct schedule_segment seg;
    vlp16(&e);
    const struct schedule_spec spec = turning(&e, 10 * HZ);
    schedule_start(&seg, &spec);
    for (int i = 0; i < 20000; i++) {
        const uint64_t k = some_pulse(&cases, i);
        const int64_t t_ns = vlp16_ns(k);
        assert_int_equal(schedule_time_ns(&seg, k), t_ns);
        assert_int_equal(schedule_pulse_at(&seg, t_ns), k);
        if (k > 0) assert_int_equal(schedule_pulse_at(&seg, vlp16_ns(k - 1) + 1), k);
        /* Ten turns a second: the azimuth is t / 100 ms. The share of a turn is good to a rounding of each of its
         * two terms, which are below 1. */
        assert_int_equal(schedule_line_of(&seg, k), t_ns / 100000000);
        assert_true(fabs(schedule_pan_turn(&seg, k) - (double)(t_ns % 100000000) / 1e8) < 0x1p-51);
        assert_true(schedule_mirror_turn(&seg, k) ==
                    (k % 2 == 0 ? -15.0 + (double)(k % 16) : (double)(k % 16)) / 360.0);
    }
    assert_true(schedule_pulse_at(&seg, DAY_NS) == (uint64_t)DAY_NS / 55296 * 16); /* 86400 s are whole sequences */
}

/* A sequence of a head whose period is no whole number of nanoseconds. */
static void rational_sequences_are_exact(void **state)
{
    (void)state;
    static const struct emitter_beam beam[3] = {{0, 0, 0}, {1000000, 0, 7}, {2000000, 0, 400}};
    uint64_t cases = 12;
    for (int c = 0; c < 200; c++) {
        struct emitter e;
        struct schedule_segment seg;
        const uint64_t sequence_ps = (uint64_t)case_between(&cases, 400001, 5000000);
        assert_int_equal(emitter_set_beams(&e, beam, 3, sequence_ps, 1, NULL), SH_OK);
        const struct schedule_spec spec = turning(&e, 7 * HZ);
        schedule_start(&seg, &spec);
        for (int i = 0; i < 50; i++) {
            const uint64_t k = (uint64_t)case_between(&cases, 0, INT64_C(1) << (i % 40 + 1));
            const u128 ps = (u128)(k / 3) * sequence_ps + 1000u * (u128)beam[k % 3].offset_ns;
            assert_int_equal(schedule_time_ns(&seg, k), (int64_t)(ps / 1000));
            assert_int_equal(schedule_line_of(&seg, k), (uint64_t)(ps * 7 / 1000000000000));
        }
    }
}

/* A run may begin at any beam of the sequence: its pulses fire when they are scheduled. */
static void runs_begin_at_any_beam(void **state)
{
    (void)state;
    enum { N = 40 };
    struct emitter e;
    struct schedule_segment seg;
    struct schedule_line line;
    vlp16(&e);
    const struct schedule_spec spec = turning(&e, 10 * HZ);
    schedule_start(&seg, &spec);
    schedule_get_line(&seg, 1, &line);
    for (uint64_t k = line.cast0; k < line.cast0 + 16; k++) {
        struct schedule_run run;
        uint32_t dt_ns[N];
        schedule_get_run(&seg, &line, k, N, &run);
        kernel_times(&run, dt_ns);
        for (uint32_t j = 0; j < N; j++)
            assert_int_equal(run.t0_ns + dt_ns[j], vlp16_ns(k + j));
    }
}

/* ---- turns, and changes of their rate */

/* A turn's first pulse is the first that fires at or after the turn's begin, wherever in a sequence. */
static void turns_take_all_pulses(void **state)
{
    (void)state;
    struct emitter e;
    struct schedule_segment seg;
    struct schedule_line line;
    vlp16(&e);
    const struct schedule_spec spec = turning(&e, 10 * HZ);
    schedule_start(&seg, &spec);
    uint64_t next = 0;
    int within = 0;
    for (uint64_t n = 0; n < 2000; n++) {
        schedule_get_line(&seg, n, &line);
        assert_int_equal(line.pulse0, next);
        assert_true(vlp16_ns(line.pulse0) >= (int64_t)n * 100000000);
        assert_true(n == 0 || vlp16_ns(line.pulse0 - 1) < (int64_t)n * 100000000);
        assert_int_equal(line.cast0, line.pulse0);
        assert_int_equal(line.cast_end, line.pulse_end);
        assert_int_equal(line.begin_ns, vlp16_ns(line.pulse0));
        assert_int_equal(line.frame, n); /* a turn is a frame */
        assert_true(line.last_of_frame);
        within += line.pulse0 % 16 != 0;
        next = line.pulse_end;
    }
    assert_true(within > 500); /* most begin within a sequence */
}

/* Rates of turns change anywhere, also within a sequence. Firing times and the firing's number go on, the azimuth
 * continues, and no pulse is lost or doubled. */
static void turn_rates_change_anywhere(void **state)
{
    (void)state;
    uint64_t cases = 13, next = 0, cast = 0, k = 0;
    struct emitter e;
    struct schedule_segment seg;
    vlp16(&e);
    struct schedule_spec spec = turning(&e, 10 * HZ);
    schedule_start(&seg, &spec);
    /* Turns so far are a sum of whole numbers, of micro-hertz times nanoseconds. */
    u128 turned = 0;
    int64_t last_ns = 0;
    for (int i = 0; i < 3000; i++) {
        k += (uint64_t)case_between(&cases, 1, 70000);
        turned += (u128)(uint64_t)spec.lines_uhz * (uint64_t)(vlp16_ns(k) - last_ns);
        last_ns = vlp16_ns(k);
        const uint64_t line = schedule_line_of(&seg, k);
        take_lines(&seg, &next, &cast, k);
        spec.lines_uhz = case_between(&cases, 5 * HZ, 20 * HZ);
        schedule_change(&seg, &seg, &spec, k);
        assert_int_equal(schedule_line_of(&seg, k), line);
        assert_int_equal(schedule_time_ns(&seg, k), vlp16_ns(k));
        assert_int_equal(schedule_time_ns(&seg, k + 1000), vlp16_ns(k + 1000));
        assert_true(schedule_mirror_turn(&seg, k) ==
                    (k % 2 == 0 ? -15.0 + (double)(k % 16) : (double)(k % 16)) / 360.0);
        /* Each change rounds the phase down to 2^-40 of a turn. After i changes it is less than i of these behind. */
        const double within = (double)(turned % 1000000000000000u) / 1e15;
        double behind = within - schedule_pan_turn(&seg, k);
        behind -= floor(behind + 0.5);
        assert_true(behind > -1e-14 && behind < (i + 2) * 0x1p-40);
    }
    assert_int_equal(next, k);
    assert_int_equal(cast, k);
}

/* A window is an interval of the head's azimuth. A beam's own azimuth does not matter. */
static void a_window_cuts_turns(void **state)
{
    (void)state;
    struct emitter e;
    struct schedule_segment seg;
    struct schedule_line line;
    vlp16(&e);
    struct schedule_spec spec = turning(&e, 10 * HZ);
    spec.line_start_udeg = 30 * INT64_C(1000000); /* 25/3 ms of a turn of 100 ms, 50/3 ms */
    spec.line_stop_udeg = 60 * INT64_C(1000000);
    schedule_start(&seg, &spec);
    for (uint64_t n = 0; n < 300; n++) {
        schedule_get_line(&seg, n, &line);
        const double first_ns = (double)n * 1e8 + 1e8 / 12, last_ns = (double)n * 1e8 + 1e8 / 6;
        assert_true((double)vlp16_ns(line.cast0) >= first_ns && (double)vlp16_ns(line.cast0 - 1) < first_ns);
        assert_true((double)vlp16_ns(line.cast_end) > last_ns && (double)vlp16_ns(line.cast_end - 1) <= last_ns);
    }
}

/* The head turns the other way round. A beam's own azimuth is clockwise all the same. */
static void beams_turn_either_way(void **state)
{
    (void)state;
    static const struct emitter_beam beam[2] = {{0, 90000000, 0}, {0, -36000000, 1000}};
    for (int turn = -1; turn <= 1; turn += 2) {
        struct emitter e;
        struct schedule_segment seg;
        assert_int_equal(emitter_set_beams(&e, beam, 2, 4000000, turn, NULL), SH_OK);
        const struct schedule_spec spec = turning(&e, 10 * HZ);
        schedule_start(&seg, &spec);
        for (uint64_t k = 0; k < 40000; k += 37) {
            const double at = (double)(k / 2 * 4000 + k % 2 * 1000) / 1e8, own = k % 2 == 0 ? 0.25 : -0.1;
            assert_true(fabs(schedule_pan_turn(&seg, k) - (turn * at + own)) < 1e-14);
        }
    }
}

/* The figures of a run are those of the schedule for each pulse. */
static void runs_say_the_same(void **state)
{
    (void)state;
    uint64_t cases = 14;
    struct emitter e;
    struct schedule_segment seg;
    struct schedule_line line;
    struct schedule_run run;
    vlp16(&e);
    const struct schedule_spec spec = turning(&e, 20 * HZ);
    schedule_start(&seg, &spec);
    for (int i = 0; i < 2000; i++) {
        const uint64_t k = (uint64_t)case_between(&cases, 0, INT64_C(1) << 40);
        schedule_get_line(&seg, schedule_line_of(&seg, k), &line);
        schedule_get_run(&seg, &line, k, 1, &run);
        assert_int_equal(run.t0_ns, vlp16_ns(k));
        assert_int_equal(run.line_t0_ns, vlp16_ns(line.pulse0));
        assert_int_equal(run.in_line, k - line.pulse0);
        assert_ptr_equal(run.firing, e.firing);
        assert_int_equal(run.firing_at, k % 16);
        assert_int_equal(run.n_firings, 16);
        assert_int_equal(run.sequence_ticks, 24);
        /* 20 turns a second */
        assert_true(fabs((double)run.r * run.pan_turn_per_r - (double)(vlp16_ns(k) % 50000000) / 5e7) < 0x1p-51);
    }
    /* The longest run that fits into so many nanoseconds fits wherever it begins. */
    const uint64_t longest = schedule_longest_run(&seg, 16777215);
    assert_true(longest > 4700);
    for (uint64_t k = 0; k < 16; k++)
        assert_true(vlp16_ns(k + longest - 1) - vlp16_ns(k) <= 16777215);
    assert_int_equal(schedule_longest_run(&seg, 100), 1);
}

/* The time from one firing sequence to the next is a fraction in lowest terms. Without a table it is a pulse's. */
static void sequences_last_a_ratio_of_nanoseconds(void **state)
{
    (void)state;
    static const struct {
        int64_t prr_uhz;
        uint64_t num, den;
    } is[] = {{300000000000, 10000, 3}, {1000000000000, 1000, 1}, {2200000000000, 5000, 11}, {1, 1000000000000000, 1}};
    struct emitter e;
    struct schedule_segment seg;
    uint64_t num, den;
    for (size_t i = 0; i < sizeof is / sizeof is[0]; i++) {
        struct schedule_spec spec = plain_schedule(1);
        spec.prr_uhz = is[i].prr_uhz;
        spec.lines_uhz = 1;
        schedule_start(&seg, &spec);
        schedule_sequence_ns(&seg, &num, &den);
        assert_int_equal(num, is[i].num);
        assert_int_equal(den, is[i].den);
    }
    vlp16(&e);
    struct schedule_spec spec = turning(&e, 20000000);
    schedule_start(&seg, &spec);
    schedule_sequence_ns(&seg, &num, &den);
    assert_true(num == 55296 && den == 1);
    static const struct emitter_beam beams[2] = {{0, 0, 0}, {0, 0, 9}};
    assert_int_equal(emitter_set_beams(&e, beams, 2, 12500, 1, NULL), SH_OK);
    spec = turning(&e, 20000000);
    schedule_start(&seg, &spec);
    schedule_sequence_ns(&seg, &num, &den);
    assert_true(num == 25 && den == 2);
}

/* ---- refusals */

static void refused(const struct emitter_beam *beam, uint32_t n, uint64_t sequence_ps, const char *says)
{
    struct emitter e;
    struct sh_err err;
    assert_int_equal(emitter_set_beams(&e, beam, n, sequence_ps, 1, &err), SH_EINPUT);
    if (strstr(err.text, says) == NULL) fail_msg("%s", err.text);
}

static void tables_that_do_not_fit_are_refused(void **state)
{
    (void)state;
    static const struct emitter_beam late[2] = {{0, 0, 5}, {0, 0, 9}}, still[2] = {{0, 0, 0}, {0, 0, 0}},
                                     back[3] = {{0, 0, 0}, {0, 0, 9}, {0, 0, 8}}, good[2] = {{0, 0, 0}, {0, 0, 9}};
    refused(good, 0, 1000, "0 beams; allowed 1 to 128");
    refused(good, 129, 1000, "129 beams");
    refused(late, 2, 100000, "the first beam fires after 5 ns; allowed 0");
    refused(still, 2, 100000, "beam 2 fires after 0 ns, but the beam before it after 0 ns; allowed more");
    refused(back, 3, 100000, "beam 3 fires after 8 ns");
    refused(good, 2, 9000, "9 ns ends before its last firing; allowed more than 9 ns");
    struct emitter e;
    assert_int_equal(emitter_set_beams(&e, good, 2, 9001, 1, NULL), SH_OK);
    assert_int_equal(e.tick_den, 1000);
}

/* A run may begin at any row of its table, and be cast in parts. Its pulses take one row after the other. For each
 * round of the table the pan turns by one sequence (struct schedule_run). */
static void angles_follow_the_table(void **state)
{
    (void)state;
    enum { N = 12 };
    static const struct emitter_firing firing[3] = {{0, 0.125, 0.5}, {2, -0.25, 0.0}, {7, 0.375, 0.25}};
    struct schedule_run run = {
        .r = 5, .num = 3, .firing = firing, .n_firings = 3, .sequence_ticks = 10, .pan_turn_per_r = 0x1p-10};
    for (run.firing_at = 0; run.firing_at < 3; run.firing_at++)
        for (uint32_t first = 0; first < 7; first++) {
            double mirror[N], pan[N];
            aimed_angles(&run, first, N, mirror, pan);
            for (uint32_t i = 0; i < N; i++) {
                const uint32_t k = run.firing_at + first + i, row = k % 3;
                const uint64_t ticks = k / 3 * 10 + firing[row].tick - firing[run.firing_at].tick;
                assert_true(mirror[i] == firing[row].mirror_turn);
                assert_true(pan[i] == (double)(5 + 3 * ticks) / 1024.0 + firing[row].pan_turn);
            }
        }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_rate_is_no_whole_number),
        cmocka_unit_test(an_hour_and_a_day_are_exact),
        cmocka_unit_test(rational_sequences_are_exact),
        cmocka_unit_test(runs_begin_at_any_beam),
        cmocka_unit_test(turns_take_all_pulses),
        cmocka_unit_test(turn_rates_change_anywhere),
        cmocka_unit_test(a_window_cuts_turns),
        cmocka_unit_test(beams_turn_either_way),
        cmocka_unit_test(runs_say_the_same),
        cmocka_unit_test(sequences_last_a_ratio_of_nanoseconds),
        cmocka_unit_test(tables_that_do_not_fit_are_refused),
        cmocka_unit_test(angles_follow_the_table),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
