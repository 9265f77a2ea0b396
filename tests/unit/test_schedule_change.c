/* SPDX-License-Identifier: MIT */
/* Settings that change in the middle of a scan. Nothing is lost or doubled, and time, mirror and pan continue from
 * where they were. */
#include "tests/unit/schedule_rig.h"

#include <inttypes.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

static const long double FINE = 16777216.0L; /* steps of the pan per micro-degree */

static struct schedule_spec any_spec(uint64_t *seed, struct schedule_spec s)
{
    s.prr_uhz = case_between(seed, 0, 3) == 0 ? case_between(seed, 1, 2200) * 1000 * HZ
                                              : case_between(seed, 1000 * HZ, 2200000 * HZ);
    s.lines_uhz =
        case_between(seed, 0, 1) == 0 ? case_between(seed, 3, 240) * HZ : case_between(seed, 3 * HZ, 240 * HZ);
    s.pan_udeg_s = case_between(seed, 0, 3) == 0 ? case_between(seed, 1, 60) * DEG : case_between(seed, 1000, 60 * DEG);
    s.line_start_udeg = case_between(seed, s.fov_min_udeg, s.fov_min_udeg + s.sweep_udeg);
    s.line_stop_udeg = case_between(seed, s.line_start_udeg, s.fov_min_udeg + s.sweep_udeg);
    s.pan_start_udeg = case_between(seed, -180 * DEG, 180 * DEG);
    s.pan_stop_udeg = case_between(seed, s.pan_start_udeg, s.pan_start_udeg + 360 * DEG);
    s.frames = (uint32_t)case_between(seed, 0, 3);
    return s;
}

/* Returns r of pulse k in its line. */
static uint64_t place(const struct schedule_segment *seg, uint64_t k)
{
    return (uint64_t)(((u128)seg->r0 + (u128)(k - seg->k0) * seg->num) % seg->den);
}

/* Returns the pan of pulse k in steps of 2^-24 udeg, with its fraction. */
static long double exact_pan(const struct schedule_segment *seg, uint64_t k, const struct schedule_line *line)
{
    uint64_t first = seg->k0;
    int64_t base = seg->pan0_fine;
    if (line->frame != seg->frame0) {
        struct schedule_line begin;
        schedule_get_line(seg, seg->frame0_end + (line->frame - seg->frame0 - 1) * seg->frame_lines, &begin);
        first = begin.pulse0;
        base = seg->spec.pan_start_udeg * (1 << 24);
    }
    long double turned =
        (long double)(k - first) * (long double)seg->spec.pan_udeg_s * HZ / (long double)seg->spec.prr_uhz;
    return (long double)base + turned * FINE;
}

static void check_continuity(const struct schedule_segment *before, const struct schedule_segment *after, uint64_t k)
{
    struct schedule_line was, is;
    assert_true(after->k0 == k && schedule_time_ns(after, k) == schedule_time_ns(before, k));
    assert_true(schedule_line_of(before, k) == schedule_line_of(after, k));
    schedule_get_line(before, schedule_line_of(before, k), &was);
    schedule_get_line(after, schedule_line_of(after, k), &is);
    assert_true(is.frame == was.frame && is.line == was.line);
    assert_true(is.pulse0 == k && is.pulse_end > k && is.r_first_pulse == after->r0);
    /* 0 <= r/den before - r/den after < 1/den after */
    i128 lag = (i128)place(before, k) * after->den - (i128)after->r0 * before->den;
    assert_true(lag >= 0 && lag < (i128)before->den);
    /* The long double's own steps at 6e15 are far below one. */
    assert_true(fabsl((long double)after->pan0_fine - exact_pan(before, k, &was)) <= 1.0L);
    assert_true(schedule_pan_turn(after, k) == (double)after->pan0_fine / (360e6 * 16777216.0));
}

/* The current frame ends with the first line whose end has the pan at its stop, or with the current line. */
static void check_frame_end(const struct schedule_segment *seg)
{
    long double stop = (long double)seg->spec.pan_stop_udeg * FINE;
    uint64_t lines = seg->frame0_end - seg->line0;
    if (seg->spec.pan_udeg_s == 0) {
        assert_true(lines == 1);
        return;
    }
    long double per_line = (long double)seg->spec.pan_udeg_s * HZ / (long double)seg->spec.lines_uhz * FINE;
    long double at_end =
        (long double)seg->pan0_fine + ((long double)lines - (long double)seg->r0 / (long double)seg->den) * per_line;
    if (at_end < stop - 2.0L) fail_msg("the frame ends %.3Lg lines short of the stop", (stop - at_end) / per_line);
    if (lines > 1 && at_end - per_line > stop + 2.0L)
        fail_msg("the frame goes %.3Lg lines beyond the stop", (at_end - stop) / per_line);
}

static void nothing_jumps_when_everything_changes(void **state)
{
    (void)state;
    uint64_t seed = 1;
    for (int scan = 0; scan < 500; scan++) {
        struct schedule_spec spec = any_spec(&seed, plain_schedule(0));
        struct schedule_segment seg, next;
        schedule_start(&seg, &spec);
        for (int change = 0; change < 40; change++) {
            int64_t ahead_us = change % 4 ? case_between(&seed, 0, 20000) : case_between(&seed, 0, 20000000);
            uint64_t k = schedule_pulse_at(&seg, seg.t0_ns + ahead_us * 1000);
            if (change % 3 == 0) k = schedule_cut(&seg, k);
            if (k >= seg.end_pulse) break;
            spec = any_spec(&seed, spec);
            schedule_change(&next, &seg, &spec, k);
            check_continuity(&seg, &next, k);
            check_frame_end(&next);
            assert_true(next.end_pulse > k);
            if (k > seg.k0) assert_true(schedule_time_ns(&seg, k - 1) <= schedule_time_ns(&next, k));
            schedule_change(&seg, &seg, &spec, k); /* in place */
            assert_memory_equal(&seg, &next, sizeof seg);
        }
    }
}

/* Takes every pulse of a scan in order, as ticks do, with changes on the way. Lines follow each other without a gap,
 * none begins twice, and each pulse is cast or blind by its phase. */
static void lines_stay_whole_through_changes(void **state)
{
    (void)state;
    uint64_t seed = 2;
    for (int scan = 0; scan < 100; scan++) {
        struct schedule_spec spec = any_spec(&seed, plain_schedule(0));
        struct schedule_segment seg;
        spec.prr_uhz = case_between(&seed, 1000, 20000) * HZ;
        schedule_start(&seg, &spec);
        uint64_t at = 0, line_begin = 0, line_cast = 0, n_line = 0;
        int64_t t_line = 0;
        for (int64_t t = 1000000; t < 100000000 && at < seg.end_pulse; t += 1000000) {
            if (case_between(&seed, 0, 9) == 0) {
                spec = any_spec(&seed, spec);
                spec.prr_uhz = case_between(&seed, 1000, 20000) * HZ;
                schedule_change(&seg, &seg, &spec, at);
            }
            uint64_t end = schedule_cut(&seg, schedule_pulse_at(&seg, t));
            for (; at < end && at < seg.end_pulse; at++) {
                struct schedule_line line;
                assert_true(schedule_line_of(&seg, at) == n_line);
                schedule_get_line(&seg, n_line, &line);
                assert_true(line.begin == line_begin && line.begin_ns == t_line && line.begin <= line.pulse0);
                int in_window = place(&seg, at) >= seg.r_first && place(&seg, at) <= seg.r_last;
                assert_true((at >= line.cast0 && at < line.cast_end) == in_window);
                if (at >= line.cast0)
                    assert_true(line.cast_before +
                                    (at < line.cast_end ? at - line.cast0 : line.cast_end - line.cast0) ==
                                line_cast);
                line_cast += (uint64_t)in_window;
                if (at + 1 < line.pulse_end) continue;
                n_line++;
                line_cast = 0;
                line_begin = at + 1;
                t_line = schedule_time_ns(&seg, at + 1);
            }
        }
    }
}

/* A change to the present settings, at any moment, doesn't move the frame's end. */
static void a_change_of_nothing_changes_nothing(void **state)
{
    (void)state;
    uint64_t seed = 3;
    for (int i = 0; i < 20000; i++) {
        struct schedule_spec spec = any_spec(&seed, plain_schedule(0));
        struct schedule_segment seg, next;
        spec.frames = 2;
        if (i % 2) { /* a whole number of lines fits the sweep exactly */
            spec.lines_uhz = 100 * HZ;
            spec.pan_udeg_s = 18 * DEG;
            spec.pan_stop_udeg = spec.pan_start_udeg + 180000 * case_between(&seed, 1, 2000);
        }
        if (spec.pan_stop_udeg == spec.pan_start_udeg) spec.pan_stop_udeg += DEG;
        schedule_start(&seg, &spec);
        uint64_t k = (uint64_t)case_between(&seed, 0, (int64_t)(seg.end_pulse / 2) - 1);
        schedule_change(&next, &seg, &spec, k);
        assert_true(next.r0 == place(&seg, k));
        if (next.end_pulse != seg.end_pulse || next.frame0_end != (next.frame0 + 1) * seg.frame_lines)
            fail_msg("end %" PRIu64 " becomes %" PRIu64 ", of %" PRIu64 " pulses a frame", seg.end_pulse,
                     next.end_pulse, seg.end_pulse / 2);
        for (int j = 0; j < 5; j++) {
            uint64_t later = (uint64_t)case_between(&seed, (int64_t)k, (int64_t)seg.end_pulse - 1);
            assert_true(schedule_line_of(&seg, later) == schedule_line_of(&next, later));
            assert_true(llabs(schedule_time_ns(&seg, later) - schedule_time_ns(&next, later)) <= 1); /* two floors */
            assert_true(fabs(schedule_pan_turn(&seg, later) - schedule_pan_turn(&next, later)) < 6e-16);
            assert_true(schedule_mirror_turn(&seg, later) == schedule_mirror_turn(&next, later));
        }
    }
}

static void a_stop_that_is_behind_ends_the_frame_with_its_line(void **state)
{
    (void)state;
    struct schedule_spec spec = plain_schedule(0);
    struct schedule_segment seg;
    struct schedule_line line;
    spec.frames = 2;
    schedule_start(&seg, &spec);
    spec.pan_stop_udeg = 10 * DEG;
    uint64_t k = 300000 * 5 + 1500; /* at 90 degrees, in the middle of line 500 */
    schedule_change(&seg, &seg, &spec, k);
    schedule_get_line(&seg, 500, &line);
    assert_true(line.frame == 0 && line.last_of_frame && line.pulse_end == k + 1500);
    schedule_get_line(&seg, 501, &line);
    assert_true(line.frame == 1 && !line.last_of_frame);
    assert_true(schedule_pan_turn(&seg, line.pulse0) == 0.0);
    assert_true(seg.end_pulse == k + 1500 + 56 * 3000); /* 10 deg at 0.18 deg a line */
}

static void frames_fewer_than_done_end_with_the_one_at_hand(void **state)
{
    (void)state;
    struct schedule_spec spec = plain_schedule(0);
    struct schedule_segment seg;
    struct schedule_line line;
    spec.frames = 5;
    schedule_start(&seg, &spec);
    spec.frames = 1;
    schedule_change(&seg, &seg, &spec, 3000 * 2500 + 7); /* in frame 2 */
    schedule_get_line(&seg, 2999, &line);
    assert_true(line.frame == 2 && line.last_of_frame && line.pulse_end == seg.end_pulse &&
                seg.end_pulse == 3000 * 3000);
}

/* In the third frame the number of frames is set to those done, to those with the current one, and to one more. */
static void frames_may_be_set_to_those_done(void **state)
{
    (void)state;
    static const uint32_t frames[] = {2, 3, 4}, ends_after[] = {3, 3, 4};
    for (int i = 0; i < 3; i++) {
        struct schedule_spec spec = plain_schedule(0);
        struct schedule_segment seg;
        schedule_start(&seg, &spec);
        spec.frames = frames[i];
        schedule_change(&seg, &seg, &spec, 3000 * 2500 + 7);
        if (seg.end_pulse != UINT64_C(3000) * 1000 * ends_after[i])
            fail_msg("%u frames: ends with pulse %llu", frames[i], (unsigned long long)seg.end_pulse);
    }
}

static void a_pan_that_stops_ends_its_frame_and_keeps_its_angle(void **state)
{
    (void)state;
    struct schedule_spec spec = plain_schedule(0);
    struct schedule_segment seg;
    struct schedule_line line;
    schedule_start(&seg, &spec);
    spec.pan_udeg_s = 0;
    schedule_change(&seg, &seg, &spec, 300000 * 5 + 10);
    schedule_get_line(&seg, 500, &line);
    assert_true(line.last_of_frame && line.frame == 0);
    assert_true(schedule_pan_turn(&seg, line.pulse0) == schedule_pan_turn(&seg, line.pulse_end - 1));
    assert_true(fabs(schedule_pan_turn(&seg, line.pulse0) - 90.0006 / 360.0) < 1e-15);
    schedule_get_line(&seg, 501, &line);
    assert_true(line.last_of_frame && line.frame == 1);
}

/* Returns any settings that a profile and a configuration allow. They are tried up to 3 * 2^48 pulses and 95 years.
 * UBSan finds overflows and divisions by zero. */
static struct schedule_spec wild_spec(uint64_t *seed)
{
    struct schedule_spec s = {0};
    s.prr_uhz = case_between(seed, HZ, case_between(seed, 0, 1) ? 1000 * HZ : 10000000 * HZ);
    s.lines_uhz = case_between(seed, 250000, s.prr_uhz < 10000 * HZ ? s.prr_uhz : 10000 * HZ);
    s.pan_udeg_s = case_between(seed, 0, 4) ? case_between(seed, 0, 3600 * DEG) : case_between(seed, 0, 3);
    s.fov_min_udeg = case_between(seed, -360 * DEG, 360 * DEG);
    s.sweep_udeg = case_between(seed, 1, case_between(seed, 0, 1) ? 720 * DEG : 100);
    s.line_start_udeg = case_between(seed, s.fov_min_udeg, s.fov_min_udeg + s.sweep_udeg);
    s.line_stop_udeg = case_between(seed, s.line_start_udeg, s.fov_min_udeg + s.sweep_udeg);
    s.pan_start_udeg = case_between(seed, -360 * DEG, 360 * DEG);
    s.pan_stop_udeg = case_between(seed, s.pan_start_udeg, s.pan_start_udeg + 360 * DEG);
    s.frames = case_between(seed, 0, 1) ? (uint32_t)case_u64(seed) : 0;
    return s;
}

static void check_consistency(const struct schedule_segment *seg, uint64_t k)
{
    struct schedule_line line, next;
    struct schedule_run run;
    uint64_t n = schedule_line_of(seg, k), cut = schedule_cut(seg, k);
    schedule_get_line(seg, n, &line);
    schedule_get_line(seg, n + 1, &next);
    assert_true(line.begin <= line.pulse0 && line.pulse0 <= k && (k < line.pulse_end || k >= seg->end_pulse));
    if (line.pulse_end < seg->end_pulse)
        assert_true(next.pulse0 == line.pulse_end && schedule_line_of(seg, line.pulse_end) == n + 1);
    if (k >= seg->end_pulse) return;
    assert_true(line.cast0 >= line.pulse0 && line.cast_end >= line.cast0 && line.cast_end <= line.pulse_end);
    assert_true(next.frame - line.frame == (line.last_of_frame ? 1U : 0U));
    assert_true(cut <= k && cut >= line.pulse0 && (cut - line.pulse0) % SCHEDULE_PACKET == 0);
    schedule_get_run(seg, &line, k, 1, &run);
    assert_true(run.t0_ns == schedule_time_ns(seg, k) && run.line_t0_ns <= run.t0_ns && run.r < seg->den);
    uint64_t found = schedule_pulse_at(seg, run.t0_ns);
    assert_true(found <= k && schedule_time_ns(seg, found) == run.t0_ns);
    double mirror = schedule_mirror_turn(seg, k), pan = schedule_pan_turn(seg, k);
    double lowest = (double)seg->spec.fov_min_udeg / 360e6;
    assert_true(mirror >= lowest && mirror <= lowest + (double)seg->spec.sweep_udeg / 360e6 + 1e-15);
    assert_true(isfinite(pan) &&
                fabs(pan - (run.pan0_turn + run.in_line * run.pan_step_turn)) < 4e-15 * (1.0 + fabs(pan)));
}

static void whatever_is_allowed_is_consistent(void **state)
{
    (void)state;
    uint64_t seed = 4;
    for (int i = 0; i < 100000; i++) {
        struct schedule_spec spec = wild_spec(&seed);
        struct schedule_segment seg;
        schedule_start(&seg, &spec);
        for (int change = 0; change < 3; change++) {
            uint64_t room = (uint64_t)((u128)spec.prr_uhz * 1000000000U / (u128)HZ); /* 1e9 s */
            if (room > UINT64_C(1) << 48) room = UINT64_C(1) << 48;
            uint64_t k = seg.k0 + (case_u64(&seed) % room >> case_between(&seed, 0, 47));
            check_consistency(&seg, k);
            if (k >= seg.end_pulse) break;
            int64_t fov = spec.fov_min_udeg, sweep = spec.sweep_udeg; /* the profile's, the same for the whole run */
            spec = wild_spec(&seed);
            spec.fov_min_udeg = spec.line_start_udeg = fov;
            spec.sweep_udeg = sweep;
            spec.line_stop_udeg = fov + sweep;
            schedule_change(&seg, &seg, &spec, k);
            check_consistency(&seg, k);
        }
    }
}

/* A pulse lasts 454.54 ns at 2.2 MHz. Where settings change, the rest of a nanosecond is carried along, however often
 * they do. In this test the rate changes every seventh pulse, from 2.2 to 1.1 MHz (twice as long) and back. The time of
 * pulse k is the floor of the sum, to the nanosecond, after 20,000 changes. */
static void no_part_of_a_nanosecond_is_lost(void **state)
{
    (void)state;
    struct schedule_spec spec = plain_schedule(0);
    struct schedule_segment seg;
    uint64_t elevenths = 0; /* of 5000 / 11 ns */
    spec.prr_uhz = 2200000 * HZ;
    schedule_start(&seg, &spec);
    for (uint64_t k = 7; k < 140000; k += 7) {
        const int slow = k / 7 % 2 == 1;
        elevenths += slow ? 7 : 14; /* the pulses before: at the other rate */
        assert_true(schedule_time_ns(&seg, k) == (int64_t)(elevenths * 5000 / 11));
        spec.prr_uhz = (slow ? 1100000 : 2200000) * HZ;
        schedule_change(&seg, &seg, &spec, k);
        assert_true(schedule_time_ns(&seg, k) == (int64_t)(elevenths * 5000 / 11));
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(nothing_jumps_when_everything_changes),
        cmocka_unit_test(lines_stay_whole_through_changes),
        cmocka_unit_test(a_change_of_nothing_changes_nothing),
        cmocka_unit_test(a_stop_that_is_behind_ends_the_frame_with_its_line),
        cmocka_unit_test(frames_fewer_than_done_end_with_the_one_at_hand),
        cmocka_unit_test(frames_may_be_set_to_those_done),
        cmocka_unit_test(a_pan_that_stops_ends_its_frame_and_keeps_its_angle),
        cmocka_unit_test(whatever_is_allowed_is_consistent),
        cmocka_unit_test(no_part_of_a_nanosecond_is_lost),
    };
    return cmocka_run_group_tests_name("schedule changes", tests, NULL, NULL);
}
