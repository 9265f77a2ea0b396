/* SPDX-License-Identifier: MIT */
/* Schedules of heads that fire in steps, rings and lists, counted by hand. */
#include "tests/unit/schedule_rig.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

/* ---- planar heads */

static struct schedule_spec planar(struct emitter *e, uint32_t steps, uint32_t first, uint32_t last, uint32_t front,
                                   int64_t lines_uhz)
{
    emitter_set_planar(e, steps, first, last, front, -1);
    return (struct schedule_spec){.prr_uhz = lines_uhz * steps,
                                  .lines_uhz = lines_uhz,
                                  .fov_min_udeg = emitter_step_udeg(e, 0),
                                  .sweep_udeg = 360000000,
                                  .line_start_udeg = emitter_step_udeg(e, first),
                                  .line_stop_udeg = emitter_step_udeg(e, last),
                                  .emitter = e};
}

/* URG-04LX, UTM-30LX, TiM571, whose steps are thirds of a degree, and a turn of a prime number. */
static void a_turn_has_its_steps(void **state)
{
    (void)state;
    static const uint32_t heads[][4] = {
        {1024, 44, 725, 384}, {1440, 0, 1080, 540}, {1080, 0, 810, 405}, {7919, 13, 7901, 1000}};
    for (size_t h = 0; h < 4; h++) {
        const uint32_t steps = heads[h][0], first = heads[h][1], last = heads[h][2], front = heads[h][3];
        struct emitter e;
        struct schedule_segment seg;
        struct schedule_line line;
        const struct schedule_spec spec = planar(&e, steps, first, last, front, 15 * HZ);
        schedule_start(&seg, &spec);
        for (uint64_t n = 0; n < 100; n += 9) {
            schedule_get_line(&seg, n, &line);
            assert_int_equal(line.pulse0, n * steps);
            assert_int_equal(line.cast0, n * steps + first);
            assert_int_equal(line.cast_end, n * steps + last + 1);
            assert_int_equal(line.pulse_end, (n + 1) * steps);
            assert_int_equal(line.begin_ns, (int64_t)(n * 1000000000 / 15));
            for (uint32_t s = 0; s < steps; s += 7) { /* counter-clockwise: steps before the front one look right */
                const uint64_t k = n * steps + s;
                const double azimuth_turn = ((double)front - (double)s) / steps;
                assert_int_equal(schedule_time_ns(&seg, k), (int64_t)((u128)k * 1000000000 / (15u * steps)));
                assert_true(fabs(schedule_pan_turn(&seg, k) - azimuth_turn) < 1e-15);
                assert_true(schedule_mirror_turn(&seg, k) == 0.0);
            }
        }
    }
}

/* The window may be narrowed to steps. Line angles count from the front on, along the steps. */
static void a_window_is_whole_steps(void **state)
{
    (void)state;
    struct emitter e;
    struct schedule_segment seg;
    struct schedule_line line;
    struct schedule_spec spec = planar(&e, 1080, 0, 810, 405, 15 * HZ);
    assert_int_equal(emitter_step_udeg(&e, 404), -333333);
    assert_int_equal(emitter_step_udeg(&e, 407), 666667);
    for (uint32_t first = 0; first < 810; first += 31)
        for (uint32_t last = first + 1; last <= 810; last += 37) {
            spec.line_start_udeg = emitter_step_udeg(&e, first); /* rounded up or down */
            spec.line_stop_udeg = emitter_step_udeg(&e, last);
            schedule_start(&seg, &spec);
            schedule_get_line(&seg, 3, &line);
            assert_int_equal(line.cast0, 3 * 1080 + first);
            assert_int_equal(line.cast_end, 3 * 1080 + last + 1);
        }
    spec.line_start_udeg = -200 * INT64_C(1000000); /* no more than the head has */
    spec.line_stop_udeg = 200 * INT64_C(1000000);
    schedule_start(&seg, &spec);
    schedule_get_line(&seg, 0, &line);
    assert_int_equal(line.cast_end - line.cast0, 811);
}

/* The rate changes in the middle of a turn, and the steps go on. */
static void a_planar_head_keeps_its_steps(void **state)
{
    (void)state;
    uint64_t cases = 15, k = 0, next = 0, pulses = 0;
    struct emitter e;
    struct schedule_segment seg;
    struct schedule_spec spec = planar(&e, 1024, 44, 725, 384, 10 * HZ);
    schedule_start(&seg, &spec);
    for (int i = 0; i < 500; i++) {
        k += (uint64_t)case_between(&cases, 1, 5000);
        take_lines(&seg, &next, &pulses, k);
        spec.lines_uhz = case_between(&cases, 9 * HZ, 10 * HZ);
        spec.prr_uhz = 1024 * spec.lines_uhz;
        schedule_change(&seg, &seg, &spec, k);
        assert_int_equal(schedule_line_of(&seg, k), k / 1024);
        assert_true(fabs(schedule_pan_turn(&seg, k) - (384.0 - (double)(k % 1024)) / 1024) < 1e-15);
    }
    assert_int_equal(pulses, k);
}

/* ---- spheres and lists */

/* A line is a turn of 360 degrees. pulses: those of a line. */
static struct schedule_spec turning(const struct emitter *e, int64_t lines_uhz, uint32_t pulses)
{
    return (struct schedule_spec){.prr_uhz = lines_uhz * pulses,
                                  .lines_uhz = lines_uhz,
                                  .sweep_udeg = 360000000,
                                  .line_stop_udeg = 360000000,
                                  .emitter = e};
}

static void a_sphere_goes_from_pole_to_pole(void **state)
{
    (void)state;
    struct emitter e;
    struct schedule_segment seg;
    struct schedule_line line;
    emitter_set_sphere(&e, 30 * INT64_C(1000000)); /* rings at -90, -60 .. 90 deg, of 12 steps */
    assert_int_equal(e.steps, 12);
    assert_int_equal(e.rings, 7);
    struct schedule_spec spec = turning(&e, 4 * HZ, 12);
    spec.frames = 3;
    schedule_start(&seg, &spec);
    assert_int_equal(seg.end_pulse, 3 * 7 * 12);
    for (uint64_t n = 0; n < 21; n++) {
        const uint64_t ring = n % 7;
        schedule_get_line(&seg, n, &line);
        assert_int_equal(line.frame, n / 7);
        assert_int_equal(line.last_of_frame, ring == 6);
        assert_int_equal(line.cast0, 12 * n);
        assert_int_equal(line.cast_end - line.cast0, ring == 0 || ring == 6 ? 1 : 12);
        for (uint64_t s = 0; s < 12; s++) {
            assert_true(fabs(schedule_mirror_turn(&seg, 12 * n + s) - (30.0 * (double)ring - 90.0) / 360) < 1e-15);
            assert_true(fabs(schedule_pan_turn(&seg, 12 * n + s) - (double)s / 12) < 1e-15);
        }
        if (n == 9) { /* in the middle of the second sphere: the frame ends where it would have ended */
            schedule_change(&seg, &seg, &spec, 12 * n + 5);
            schedule_get_line(&seg, n, &line);
            assert_int_equal(line.begin, 12 * n);
            assert_int_equal(line.cast_before, 5);
        }
    }
}

static void odd_steps_are_rounded(void **state)
{
    (void)state;
    struct emitter e;
    char text[200];
    emitter_set_sphere(&e, 3500000); /* 102.86 steps, 51.43 gaps between rings */
    assert_int_equal(e.steps, 103);
    assert_int_equal(e.rings, 52);
    emitter_describe(&e, text, sizeof text);
    assert_non_null(strstr(text, "3.5 deg, as asked, does not divide 180 deg"));
    emitter_set_sphere(&e, 2000000);
    emitter_describe(&e, text, sizeof text);
    assert_null(strstr(text, "does not divide"));
}

/* The text of each kind; where there is less room, it ends earlier. */
static void emitters_are_described(void **state)
{
    (void)state;
    static const struct emitter_beam beams[2] = {{0, 0, 0}, {0, 0, 9}};
    static const char *const texts[] = {
        "",
        "planar, steps 44..725 of 1024 a turn, 384 ahead, counter-clockwise",
        "beams, 2 in a sequence of 12.5 ns, turning clockwise",
        "sphere, 181 rings 1 deg apart, of 360 steps of 1 deg",
        "sphere, 31 rings 1 deg apart, of 360 steps of 1 deg; elevations -10 to 20 deg",
        "sphere, a circle at 7.25 deg, of 360 steps of 1 deg",
        "sphere, 27 rings 6.92308 deg apart, of 51 steps of 7.05882 deg; 7 deg, as asked, does not divide 180 deg",
        "directions, a list of 5"};
    struct emitter e[8] = {[7] = {0}};
    struct sh_err err;
    emitter_set_planar(&e[1], 1024, 44, 725, 384, -1);
    assert_int_equal(emitter_set_beams(&e[2], beams, 2, 12500, 1, &err), SH_OK);
    for (int k = 3; k < 7; k++)
        emitter_set_sphere(&e[k], k == 6 ? 7000000 : 1000000);
    assert_int_equal(emitter_set_rings(&e[4], -10000000, 20000000, &err), SH_OK);
    assert_int_equal(emitter_set_rings(&e[5], 7250000, 7250000, &err), SH_OK);
    emitter_set_directions(&e[7], NULL, 5);
    for (int k = 0; k < 8; k++)
        for (size_t room = 1; room < 200; room++) {
            char text[201], want[201];
            memset(text, '#', sizeof text);
            emitter_describe(&e[k], text, room);
            snprintf(want, room, "%s", texts[k]);
            assert_string_equal(text, want);
            assert_int_equal(text[room], '#');
        }
}

static void a_list_goes_row_by_row(void **state)
{
    (void)state;
    static const struct emitter_firing list[5] = {
        {0, 0, 0}, {1, 0.125, 0.25}, {2, -0.25, 0}, {3, 0, -0.375}, {4, 0.1, 0.9}};
    struct emitter e;
    struct schedule_segment seg;
    struct schedule_line line;
    emitter_set_directions(&e, list, 5);
    const struct schedule_spec spec = turning(&e, 3 * HZ, 5);
    schedule_start(&seg, &spec);
    for (uint64_t k = 0; k < 300; k++) {
        schedule_get_line(&seg, schedule_line_of(&seg, k), &line);
        assert_int_equal(line.pulse0, k / 5 * 5);
        assert_int_equal(line.cast0, line.pulse0);
        assert_int_equal(line.cast_end, line.pulse0 + 5);
        assert_int_equal(schedule_time_ns(&seg, k), (int64_t)(k * 1000000000 / 15));
        assert_true(schedule_mirror_turn(&seg, k) == list[k % 5].mirror_turn);
        assert_true(schedule_pan_turn(&seg, k) == list[k % 5].pan_turn);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_turn_has_its_steps),          cmocka_unit_test(a_window_is_whole_steps),
        cmocka_unit_test(a_planar_head_keeps_its_steps), cmocka_unit_test(a_sphere_goes_from_pole_to_pole),
        cmocka_unit_test(odd_steps_are_rounded),         cmocka_unit_test(emitters_are_described),
        cmocka_unit_test(a_list_goes_row_by_row),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
