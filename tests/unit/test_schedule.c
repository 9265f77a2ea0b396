/* SPDX-License-Identifier: MIT */
/* These tests compare the schedule with a model of their own: each pulse's time, place and angle as one fraction in
 * 128-bit integers. */
#include "tests/unit/schedule_rig.h"

#include <inttypes.h>
#include <math.h>
#include <string.h>

static const int64_t PRR_FAST = 2200000 * HZ;

/* floor(a / b) and ceil(a / b) for b > 0. */
static i128 floor_of(i128 a, i128 b)
{
    return a / b - (a % b < 0);
}

static i128 ceil_of(i128 a, i128 b)
{
    return -floor_of(-a, b);
}

/* --- time --- */

static const int64_t RATES_UHZ[] = {2200000 * HZ,
                                    300000 * HZ,
                                    1000000 * HZ,
                                    333333333333,
                                    666666666667,
                                    1,
                                    3,
                                    7,
                                    999983 * HZ,
                                    1299709 * HZ,
                                    142857142857,
                                    2199999999997,
                                    10000000 * HZ,
                                    HZ,
                                    999999999989,
                                    1234567890123};
enum { N_RATES = sizeof RATES_UHZ / sizeof *RATES_UHZ };

static void start_at(struct schedule_segment *seg, int64_t prr_uhz)
{
    struct schedule_spec spec = plain_schedule(1);
    spec.prr_uhz = prr_uhz;
    spec.lines_uhz = prr_uhz < spec.lines_uhz ? prr_uhz : spec.lines_uhz;
    spec.frames = 0;
    schedule_start(seg, &spec);
}

static void check_time(const struct schedule_segment *seg, uint64_t k)
{
    u128 ns = (u128)k * 1000000000000000U / (u128)seg->spec.prr_uhz;
    if (ns > INT64_MAX) return; /* beyond 292 years */
    if (schedule_time_ns(seg, k) != (int64_t)ns)
        fail_msg("%" PRId64 " uHz, pulse %" PRIu64 ": %" PRId64 " ns", seg->spec.prr_uhz, k, schedule_time_ns(seg, k));
}

static void times_are_exact_floors(void **state)
{
    (void)state;
    uint64_t seed = 1;
    for (int r = 0; r < N_RATES + 200; r++) {
        struct schedule_segment seg;
        start_at(&seg, r < N_RATES ? RATES_UHZ[r] : case_between(&seed, 1, 10000000 * HZ));
        for (uint64_t k = 0; k < 100; k++) {
            check_time(&seg, k);
            check_time(&seg, UINT64_C(190080000000) + k); /* a day at 2.2 MHz */
            check_time(&seg, (UINT64_C(1) << 50) - k);    /* as far as the header promises */
            check_time(&seg, case_u64(&seed) >> 14);
        }
    }
}

/* 2.2 MHz for a day is a whole number of pulses, and at its end the time is right to the nanosecond. */
static void a_day_has_no_drift(void **state)
{
    (void)state;
    struct schedule_segment seg;
    start_at(&seg, PRR_FAST);
    const uint64_t day = UINT64_C(86400) * 2200000;
    for (uint64_t days = 1; days <= 3653; days += days < 30 ? 1 : 365) {
        assert_true(schedule_time_ns(&seg, days * day) == (int64_t)days * INT64_C(86400000000000));
        assert_true(schedule_pulse_at(&seg, (int64_t)days * INT64_C(86400000000000)) == days * day);
    }
    start_at(&seg, 333333333333); /* 333333.333333 Hz: this pulse is 1 us later than at 1e6/3 Hz */
    assert_true(schedule_time_ns(&seg, UINT64_C(333333333333)) == INT64_C(1000000000000000));
}

static void pulse_at_is_the_first_at_or_after(void **state)
{
    (void)state;
    uint64_t seed = 2;
    for (int r = 0; r < N_RATES; r++) {
        struct schedule_segment seg;
        start_at(&seg, RATES_UHZ[r]);
        assert_true(schedule_pulse_at(&seg, -1) == 0 && schedule_pulse_at(&seg, 0) == 0);
        for (int i = 0; i < 2000; i++) {
            int64_t t = case_between(&seed, 1, INT64_C(1) << case_between(&seed, 4, 60));
            uint64_t k = schedule_pulse_at(&seg, t);
            if (k < UINT64_C(1) << 50) assert_true(schedule_time_ns(&seg, k) >= t);
            assert_true(k > 0 && schedule_time_ns(&seg, k - 1) < t);
            if (k < UINT64_C(1) << 50) { /* a pulse's own time finds it, or an earlier one of the same nanosecond */
                uint64_t again = schedule_pulse_at(&seg, schedule_time_ns(&seg, k));
                assert_true(again <= k && schedule_time_ns(&seg, again) == schedule_time_ns(&seg, k));
            }
        }
    }
}

/* Casters compute times in this way: the start of the run, then a quotient and a remainder that carries. */
static void check_run_times(const struct schedule_segment *seg, uint64_t n_line)
{
    struct schedule_line line;
    struct schedule_run run;
    schedule_get_line(seg, n_line, &line);
    uint64_t n = line.pulse_end - line.pulse0;
    if (n > 3000) n = 3000;
    schedule_get_run(seg, &line, line.pulse0, (uint32_t)n, &run);
    assert_true(run.ns_acc < run.ns_den && run.ns_rem < run.ns_den);
    for (uint64_t j = 0; j < n; j++) {
        int64_t dt = (int64_t)j * run.ns_quot + (int64_t)(((u128)run.ns_acc + (u128)j * run.ns_rem) / run.ns_den);
        if (run.t0_ns + dt != schedule_time_ns(seg, run.pulse0 + j))
            fail_msg("pulse %" PRIu64 " of line %" PRIu64, j, n_line);
    }
}

static void runs_have_the_same_times(void **state)
{
    (void)state;
    for (int r = 0; r < N_RATES; r++) {
        struct schedule_segment seg;
        start_at(&seg, RATES_UHZ[r]);
        for (uint64_t n = 0; n < 3; n++) {
            check_run_times(&seg, n);
            check_run_times(&seg, UINT64_C(1000000) + n);
        }
    }
}

/* --- lines and the cast window --- */

/* Returns the phase of pulse k in its sweep, which is phase/prr, for a scan without changes. */
static u128 model_phase(const struct schedule_spec *s, uint64_t k)
{
    return (u128)k * (u128)s->lines_uhz % (u128)s->prr_uhz;
}

static int model_is_cast(const struct schedule_spec *s, uint64_t k)
{
    i128 angle = (i128)s->sweep_udeg * (i128)model_phase(s, k); /* times prr */
    return angle >= (i128)(s->line_start_udeg - s->fov_min_udeg) * s->prr_uhz &&
           angle <= (i128)(s->line_stop_udeg - s->fov_min_udeg) * s->prr_uhz;
}

static void check_line(const struct schedule_segment *seg, uint64_t n, struct schedule_line *line)
{
    const struct schedule_spec *s = &seg->spec;
    schedule_get_line(seg, n, line);
    uint64_t first = (uint64_t)ceil_of((i128)n * s->prr_uhz, s->lines_uhz);
    uint64_t end = (uint64_t)ceil_of((i128)(n + 1) * s->prr_uhz, s->lines_uhz);
    assert_true(line->line == n && line->pulse0 == first &&
                line->pulse_end == (end < seg->end_pulse ? end : seg->end_pulse));
    assert_true(schedule_line_of(seg, first) == n && schedule_line_of(seg, end - 1) == n &&
                schedule_line_of(seg, end) == n + 1);
    assert_true(line->pulse0 <= line->cast0 && line->cast0 <= line->cast_end && line->cast_end <= line->pulse_end);
    assert_true((i128)line->r_first_pulse * s->prr_uhz == (i128)model_phase(s, first) * (i128)seg->den);
}

static void lines_share_the_pulses_out(void **state)
{
    (void)state;
    uint64_t seed = 3;
    for (int i = 0; i < 2000; i++) {
        struct schedule_spec spec = plain_schedule(1);
        struct schedule_segment seg;
        struct schedule_line line;
        spec.prr_uhz = i % 4 == 0 ? RATES_UHZ[i / 4 % N_RATES] : case_between(&seed, HZ, PRR_FAST);
        spec.lines_uhz = case_between(&seed, 1, spec.prr_uhz < 1000 * HZ ? spec.prr_uhz : 1000 * HZ);
        spec.frames = 0;
        schedule_start(&seg, &spec);
        uint64_t n = i % 2 ? (uint64_t)case_between(&seed, 0, INT64_C(1) << 32) : 0;
        for (uint64_t j = n; j < n + 5; j++)
            check_line(&seg, j, &line);
    }
}

static void every_pulse_is_cast_or_blind_as_its_angle_says(void **state)
{
    (void)state;
    uint64_t seed = 4;
    for (int i = 0; i < 300; i++) {
        struct schedule_spec spec = plain_schedule(1);
        struct schedule_segment seg;
        struct schedule_line line;
        spec.prr_uhz = case_between(&seed, 1000, 5000) * HZ + (i % 2 ? case_between(&seed, 0, HZ) : 0);
        spec.lines_uhz = case_between(&seed, 1, 100) * HZ;
        spec.line_start_udeg = spec.fov_min_udeg + case_between(&seed, 0, spec.sweep_udeg / DEG) * DEG;
        spec.line_stop_udeg = case_between(&seed, spec.line_start_udeg, spec.fov_min_udeg + spec.sweep_udeg);
        if (i % 3 == 0) spec.line_stop_udeg -= spec.line_stop_udeg % DEG;
        if (spec.line_stop_udeg < spec.line_start_udeg) spec.line_stop_udeg = spec.line_start_udeg;
        spec.frames = 0;
        schedule_start(&seg, &spec);
        for (uint64_t n = 0; n < 4; n++) {
            check_line(&seg, n, &line);
            for (uint64_t k = line.pulse0; k < line.pulse_end; k++)
                assert_int_equal(k >= line.cast0 && k < line.cast_end, model_is_cast(&spec, k));
        }
    }
}

/* With 100 pulses a line over 100 degrees, pulse i is at exactly i degrees. */
static void both_ends_of_the_window_are_cast(void **state)
{
    (void)state;
    struct schedule_spec spec = plain_schedule(1);
    struct schedule_segment seg;
    struct schedule_line line;
    spec.prr_uhz = 1000 * HZ;
    spec.lines_uhz = 10 * HZ;
    spec.fov_min_udeg = -40 * DEG;
    spec.sweep_udeg = 100 * DEG;
    spec.line_start_udeg = -30 * DEG;
    spec.line_stop_udeg = -20 * DEG;
    schedule_start(&seg, &spec);
    schedule_get_line(&seg, 3, &line);
    assert_true(line.cast0 == 310 && line.cast_end == 321);
    spec.line_start_udeg++;
    spec.line_stop_udeg--;
    schedule_start(&seg, &spec);
    schedule_get_line(&seg, 3, &line);
    assert_true(line.cast0 == 311 && line.cast_end == 320);
    spec.line_start_udeg = -40 * DEG; /* the whole sweep: every pulse */
    spec.line_stop_udeg = 60 * DEG;
    schedule_start(&seg, &spec);
    schedule_get_line(&seg, 3, &line);
    assert_true(line.cast0 == 300 && line.cast_end == 400);
    spec.line_start_udeg = spec.line_stop_udeg = -15 * DEG - 1; /* between two pulses: none */
    schedule_start(&seg, &spec);
    schedule_get_line(&seg, 3, &line);
    assert_true(line.cast0 == line.cast_end);
}

static void one_pulse_a_line_is_a_line(void **state)
{
    (void)state;
    struct schedule_spec spec = plain_schedule(1);
    struct schedule_segment seg;
    struct schedule_line line;
    spec.prr_uhz = spec.lines_uhz = 1000 * HZ;
    spec.frames = 0;
    schedule_start(&seg, &spec);
    for (uint64_t n = 0; n < 50; n++) {
        schedule_get_line(&seg, n, &line);
        assert_true(line.pulse0 == n && line.pulse_end == n + 1 && line.cast0 == n && line.cast_end == n + 1);
    }
}

/* --- cuts --- */

static void cuts_share_the_pulses_out(void **state)
{
    (void)state;
    uint64_t seed = 5;
    for (int i = 0; i < 200; i++) {
        struct schedule_spec spec = plain_schedule(1);
        struct schedule_segment seg;
        spec.prr_uhz = case_between(&seed, 1000 * HZ, PRR_FAST);
        spec.lines_uhz = case_between(&seed, HZ, 1000 * HZ);
        spec.frames = 0;
        schedule_start(&seg, &spec);
        int64_t tick_ns = 100000 * case_between(&seed, 1, 100);
        uint64_t at = 0;
        for (int64_t t = tick_ns; t < 200 * tick_ns; t += tick_ns) {
            uint64_t due = schedule_pulse_at(&seg, t), cut = schedule_cut(&seg, due);
            assert_true(cut >= at && cut <= due && due - cut < SCHEDULE_PACKET);
            struct schedule_line line;
            schedule_get_line(&seg, schedule_line_of(&seg, cut), &line);
            assert_true((cut - line.pulse0) % SCHEDULE_PACKET == 0);
            /* Nothing of an earlier line is held back. */
            schedule_get_line(&seg, schedule_line_of(&seg, due), &line);
            assert_true(cut >= line.pulse0);
            at = cut;
        }
    }
}

/* --- frames --- */

static void a_frame_has_the_lines_that_its_sweep_needs(void **state)
{
    (void)state;
    uint64_t seed = 6;
    for (int i = 0; i < 2000; i++) {
        struct schedule_spec spec = plain_schedule(1);
        struct schedule_segment seg;
        struct schedule_line line;
        spec.prr_uhz = case_between(&seed, 1000 * HZ, PRR_FAST);
        spec.lines_uhz = i % 2 ? case_between(&seed, 3 * HZ, 240 * HZ) : case_between(&seed, 3, 240) * HZ;
        spec.pan_udeg_s = i % 3 ? case_between(&seed, 1, 60) * DEG : case_between(&seed, 1000, 60 * DEG);
        spec.pan_start_udeg = case_between(&seed, -180, 180) * DEG;
        spec.pan_stop_udeg = spec.pan_start_udeg + case_between(&seed, 1, 360) * DEG;
        spec.frames = (uint32_t)case_between(&seed, 1, 5);
        schedule_start(&seg, &spec);
        uint64_t lines = (uint64_t)ceil_of((i128)(spec.pan_stop_udeg - spec.pan_start_udeg) * spec.lines_uhz,
                                           (i128)spec.pan_udeg_s * HZ);
        for (uint32_t f = 0; f < spec.frames; f++) {
            uint64_t first = lines * f;
            schedule_get_line(&seg, first, &line);
            assert_true(line.frame == f && line.last_of_frame == (lines == 1));
            /* Each frame begins at the start, to the last bit of a turn in a double. */
            assert_true(schedule_pan_turn(&seg, line.pulse0) == (double)spec.pan_start_udeg / 360e6);
            schedule_get_line(&seg, first + lines - 1, &line);
            assert_true(line.frame == f && line.last_of_frame);
        }
        assert_true(seg.end_pulse == (uint64_t)ceil_of((i128)(lines * spec.frames) * spec.prr_uhz, spec.lines_uhz));
        schedule_get_line(&seg, lines * spec.frames - 1, &line);
        assert_true(line.pulse_end == seg.end_pulse);
    }
}

static void a_pan_at_rest_makes_frames_of_one_line(void **state)
{
    (void)state;
    for (int still = 0; still < 2; still++) {
        struct schedule_spec spec = plain_schedule(1);
        struct schedule_segment seg;
        struct schedule_line line;
        spec.frames = 3;
        spec.pan_start_udeg = 90 * DEG;
        if (still)
            spec.pan_udeg_s = 0;
        else
            spec.pan_stop_udeg = spec.pan_start_udeg;
        schedule_start(&seg, &spec);
        for (uint64_t n = 0; n < 3; n++) {
            schedule_get_line(&seg, n, &line);
            assert_true(line.frame == n && line.last_of_frame);
            for (uint64_t k = line.pulse0; k < line.pulse_end; k += 100)
                assert_true(schedule_pan_turn(&seg, k) == 0.25);
        }
        assert_true(seg.end_pulse == 9000);
    }
}

static void without_frames_there_is_no_end(void **state)
{
    (void)state;
    struct schedule_spec spec = plain_schedule(1);
    struct schedule_segment seg;
    spec.frames = 0;
    schedule_start(&seg, &spec);
    assert_true(seg.end_pulse == UINT64_MAX);
}

/* The end is beyond 64 bits. The end counts as none, and not as a small number that wrapped. */
static void an_end_beyond_all_numbers_is_never_reached(void **state)
{
    (void)state;
    struct schedule_spec spec = plain_schedule(1);
    struct schedule_segment seg;
    spec.prr_uhz = PRR_FAST;
    spec.pan_udeg_s = 1;
    spec.lines_uhz = 3 * HZ;
    spec.frames = UINT32_MAX;
    schedule_start(&seg, &spec); /* 5.4e8 lines a frame, 733333 pulses a line... */
    assert_true(seg.end_pulse == UINT64_MAX);
    spec.lines_uhz = 1000 * HZ; /* ... 1.8e11 lines a frame, in all 7.7e20 */
    schedule_start(&seg, &spec);
    assert_true(seg.end_pulse == UINT64_MAX);
}

static void mirror_and_pan_turn_as_the_rates_say(void **state)
{
    (void)state;
    uint64_t seed = 7;
    for (int i = 0; i < 20000; i++) {
        struct schedule_spec spec = plain_schedule(1);
        struct schedule_segment seg;
        spec.prr_uhz = case_between(&seed, 1000 * HZ, PRR_FAST);
        spec.lines_uhz = case_between(&seed, HZ, 240 * HZ);
        spec.pan_udeg_s = case_between(&seed, 1, 60 * DEG);
        spec.pan_start_udeg = case_between(&seed, -180 * DEG, 180 * DEG);
        spec.pan_stop_udeg = spec.pan_start_udeg + 360 * DEG;
        spec.frames = 0;
        schedule_start(&seg, &spec);
        uint64_t k = (uint64_t)case_between(&seed, 0, spec.prr_uhz / HZ * 6); /* within the first 6 s and 360 deg */
        long double mirror = (spec.fov_min_udeg + (long double)spec.sweep_udeg * (long double)model_phase(&spec, k) /
                                                      (long double)spec.prr_uhz) /
                             360e6L;
        long double pan =
            (spec.pan_start_udeg + (long double)k * (long double)spec.pan_udeg_s * HZ / (long double)spec.prr_uhz) /
            360e6L;
        /* The angle is at most half a turn, with a few roundings of 2^-53. The pan is a whole number of 2^-24 udeg
         * (1.7e-16 turns). */
        assert_true(fabsl(schedule_mirror_turn(&seg, k) - mirror) < 5e-16L);
        assert_true(fabsl(schedule_pan_turn(&seg, k) - pan) < 5e-16L);
        struct schedule_line line;
        struct schedule_run run;
        schedule_get_line(&seg, schedule_line_of(&seg, k), &line);
        schedule_get_run(&seg, &line, k, 1, &run);
        double run_mirror = run.mirror0_turn + (double)run.r * run.mirror_turn_per_r;
        double run_pan = run.pan0_turn + (double)run.in_line * run.pan_step_turn;
        assert_true(fabsl(run_mirror - mirror) < 5e-16L && fabsl(run_pan - pan) < 5e-16L);
        assert_true(run.line_t0_ns == schedule_time_ns(&seg, line.pulse0) && run.pulse0 == k);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(times_are_exact_floors),
        cmocka_unit_test(a_day_has_no_drift),
        cmocka_unit_test(pulse_at_is_the_first_at_or_after),
        cmocka_unit_test(runs_have_the_same_times),
        cmocka_unit_test(lines_share_the_pulses_out),
        cmocka_unit_test(every_pulse_is_cast_or_blind_as_its_angle_says),
        cmocka_unit_test(both_ends_of_the_window_are_cast),
        cmocka_unit_test(one_pulse_a_line_is_a_line),
        cmocka_unit_test(cuts_share_the_pulses_out),
        cmocka_unit_test(a_frame_has_the_lines_that_its_sweep_needs),
        cmocka_unit_test(a_pan_at_rest_makes_frames_of_one_line),
        cmocka_unit_test(without_frames_there_is_no_end),
        cmocka_unit_test(an_end_beyond_all_numbers_is_never_reached),
        cmocka_unit_test(mirror_and_pan_turn_as_the_rates_say),
    };
    return cmocka_run_group_tests_name("schedule", tests, NULL, NULL);
}
