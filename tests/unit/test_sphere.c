/* SPDX-License-Identifier: MIT */
/* A sphere by its angle: rings within limits of elevation, a sector of azimuths, a circle. Each pulse's line, angles
 * and whether it is cast follow from counting steps in whole numbers. Expected values use nothing of core/schedule. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "tests/unit/schedule_rig.h"

static const int64_t TURN = 360 * DEG;

struct window {
    int64_t step, ring_start, ring_stop, line_start, line_stop; /* micro-degrees */
    uint32_t steps, gaps;                                       /* 360 / step and 180 / step, rounded by hand */
};

/* Returns whether numerator / denominator is at least udeg - 1, in whole numbers. */
static int at_least(int64_t numerator, int64_t denominator, int64_t udeg)
{
    return numerator >= (udeg - 1) * denominator;
}

static int at_most(int64_t numerator, int64_t denominator, int64_t udeg)
{
    return numerator <= (udeg + 1) * denominator;
}

static int ring_is_in(const struct window *w, uint32_t j)
{
    const int64_t numerator = (int64_t)j * (TURN / 2) - 90 * DEG * w->gaps;
    return at_least(numerator, w->gaps, w->ring_start) && at_most(numerator, w->gaps, w->ring_stop);
}

static int step_is_in(const struct window *w, uint32_t s)
{
    const int after = at_least((int64_t)s * TURN, w->steps, w->line_start);
    const int before = at_most((int64_t)s * TURN, w->steps, w->line_stop);
    return w->line_start < w->line_stop ? after && before : after || before;
}

static double deviation(double turn, double want)
{
    return fabs(remainder(turn - want, 1.0));
}

/* Checks one ring: the steps within the window come in the order of azimuths, from the window's begin on; the rest is
 * blind. */
static void check_ring(const struct window *w, const struct schedule_segment *seg, uint64_t n, double elevation_turn,
                       int pole)
{
    struct schedule_line line;
    schedule_get_line(seg, n, &line);
    assert_int_equal(line.pulse0, n * w->steps);
    assert_int_equal(line.pulse_end, (n + 1) * w->steps);
    uint32_t first = 0, count = 0;
    while (w->line_start > w->line_stop && first < w->steps &&
           !at_least((int64_t)first * TURN, w->steps, w->line_start))
        first++;
    for (uint32_t i = 0; i < w->steps; i++) {
        const uint64_t k = line.pulse0 + i;
        const uint32_t step = (first + i) % w->steps;
        const int cast = k >= line.cast0 && k < line.cast_end;
        assert_int_equal(cast, step_is_in(w, step) && (!pole || count == 0));
        count += (uint32_t)cast;
        /* Both formulas round a few times at 1 turn: 2^-52 each. */
        assert_true(deviation(schedule_pan_turn(seg, k), (double)step / w->steps) < 4 * 0x1p-52);
        assert_true(fabs(schedule_mirror_turn(seg, k) - elevation_turn) < 2 * 0x1p-52);
    }
    assert_true(count > 0);
}

static void begin(const struct window *w, struct emitter *e, struct schedule_segment *seg)
{
    struct sh_err err;
    const struct schedule_spec spec = {.prr_uhz = 10 * DEG * w->steps,
                                       .lines_uhz = 10 * DEG,
                                       .sweep_udeg = TURN,
                                       .line_start_udeg = w->line_start,
                                       .line_stop_udeg = w->line_stop,
                                       .frames = 2,
                                       .emitter = e};
    emitter_set_sphere(e, w->step);
    assert_int_equal(e->steps, w->steps);
    assert_int_equal(e->gaps, w->gaps);
    assert_int_equal(emitter_set_rings(e, w->ring_start, w->ring_stop, &err), SH_OK);
    schedule_start(seg, &spec);
}

static void rings_and_sectors(void **state)
{
    (void)state;
    static const struct window windows[] = {
        {10 * DEG, -90 * DEG, 90 * DEG, 0, 360 * DEG, 36, 18},
        {10 * DEG, -25 * DEG, 30 * DEG, 345 * DEG, 20 * DEG, 36, 18},  /* across 0 */
        {10 * DEG, -20 * DEG, 90 * DEG, 350 * DEG, 349999999, 36, 18}, /* all of them, from 350 on */
        {10 * DEG, -90 * DEG, -89 * DEG, 355 * DEG, 5 * DEG, 36, 18},  /* the pole alone */
        {10 * DEG, -90 * DEG, -80 * DEG, 359 * DEG, 5 * DEG, 36, 18},  /* no step after 359 */
        {2200000, -90 * DEG, 90 * DEG, 300 * DEG, 60 * DEG, 164, 82},
        {2200000, -1 * DEG, 2195122, 10 * DEG, 20 * DEG, 164, 82}, /* 180 / 82 deg, rounded */
        {7 * DEG, -45 * DEG, 45 * DEG, 90 * DEG, 270 * DEG, 51, 26},
        {13333333, -90 * DEG, 90 * DEG, 333 * DEG, 13333333, 27, 14}, /* a step at 360 / 27 deg */
        {90 * DEG, -90 * DEG, 90 * DEG, 270 * DEG, 90 * DEG, 4, 2},
    };
    struct emitter *e = malloc(sizeof *e);
    for (size_t i = 0; i < sizeof windows / sizeof windows[0]; i++) {
        const struct window *w = &windows[i];
        struct schedule_segment seg;
        uint64_t n = 0;
        begin(w, e, &seg);
        for (int frame = 0; frame < 2; frame++)
            for (uint32_t j = 0; j <= w->gaps; j++)
                if (ring_is_in(w, j)) {
                    check_ring(w, &seg, n, -0.25 + 0.5 * j / w->gaps, j == 0 || j == w->gaps);
                    struct schedule_line line;
                    schedule_get_line(&seg, n++, &line);
                    assert_int_equal(line.frame, frame);
                }
        assert_int_equal(n, 2 * e->rings);
        assert_int_equal(seg.end_pulse, n * w->steps); /* the others are no lines */
    }
    free(e);
}

static void circles(void **state)
{
    (void)state;
    static const int64_t elevation[] = {0, -12345678, 90 * DEG};
    struct emitter *e = malloc(sizeof *e);
    for (int i = 0; i < 3; i++) {
        const struct window w = {4 * DEG, elevation[i], elevation[i], 315 * DEG, 45 * DEG, 90, 45}; /* no ring at 0 */
        struct window circle = w;
        struct schedule_segment seg;
        struct sh_err err;
        emitter_set_sphere(e, w.step);
        assert_int_equal(emitter_set_rings(e, w.ring_start, w.ring_stop, &err), SH_OK);
        assert_int_equal(e->rings, 1);
        circle.gaps = 0;
        const struct schedule_spec spec = {.prr_uhz = 10 * DEG * w.steps,
                                           .lines_uhz = 10 * DEG,
                                           .sweep_udeg = TURN,
                                           .line_start_udeg = w.line_start,
                                           .line_stop_udeg = w.line_stop,
                                           .frames = 3,
                                           .emitter = e};
        schedule_start(&seg, &spec);
        for (uint64_t n = 0; n < 3; n++)
            check_ring(&circle, &seg, n, (double)elevation[i] / (double)TURN, i == 2);
        assert_int_equal(seg.end_pulse, 3 * w.steps);
    }
    free(e);
}

static void limits_between_rings_are_refused(void **state)
{
    (void)state;
    struct emitter *e = malloc(sizeof *e);
    struct sh_err err;
    emitter_set_sphere(e, 10 * DEG);
    assert_int_equal(emitter_set_rings(e, 1 * DEG, 9 * DEG, &err), SH_EINPUT);
    assert_non_null(
        strstr(err.text, "no ring lies from 1 to 9 deg; allowed are limits around a ring, such as 0 or 10 deg"));
    assert_int_equal(emitter_set_rings(e, 1 * DEG, 10 * DEG - 1, &err), SH_OK); /* within a micro-degree */
    assert_int_equal(e->rings, 1);
    assert_true(fabs(emitter_ring_turn(e, 0) - 10.0 / 360.0) < 0x1p-52);
    free(e);
}

/* A window that changes within a ring keeps the pulse's place in it. */
static void a_change_across_zero(void **state)
{
    (void)state;
    const struct window w = {10 * DEG, -90 * DEG, 90 * DEG, 0, 360 * DEG, 36, 18};
    struct emitter *e = malloc(sizeof *e);
    struct schedule_segment seg;
    struct schedule_line line;
    begin(&w, e, &seg);
    struct schedule_spec spec = seg.spec;
    spec.line_start_udeg = 340 * DEG;
    spec.line_stop_udeg = 30 * DEG;
    schedule_change(&seg, &seg, &spec, 3 * 36 + 4);
    schedule_get_line(&seg, 3, &line);
    assert_int_equal(line.pulse0, 3 * 36 + 4);
    assert_int_equal(line.cast_end - line.cast0, 2); /* of six steps, 340 to 30 deg, the last two */
    assert_true(deviation(schedule_pan_turn(&seg, line.cast0), 20.0 / 360.0) < 4 * 0x1p-52);
    schedule_get_line(&seg, 4, &line);
    assert_int_equal(line.cast0, 4 * 36);
    assert_int_equal(line.cast_end, 4 * 36 + 6);
    free(e);
}

/* A change in the middle of a frame does not change the frame's rings: ring n is still ring n mod their number. */
static void a_change_keeps_the_frame(void **state)
{
    (void)state;
    const struct window w = {10 * DEG, -90 * DEG, 90 * DEG, 0, 360 * DEG, 36, 18};
    struct emitter *e = malloc(sizeof *e);
    struct schedule_segment seg;
    struct schedule_line line;
    begin(&w, e, &seg);
    const uint64_t end = seg.end_pulse;
    for (uint64_t k = 100; k < 1300; k += 400) {
        schedule_change(&seg, &seg, &seg.spec, k);
        assert_int_equal(seg.end_pulse, end);
        for (uint64_t n = k / 36; n < 38; n++) {
            schedule_get_line(&seg, n, &line);
            assert_int_equal(line.frame, n / 19);
            assert_int_equal(line.last_of_frame, n % 19 == 18);
            assert_true(deviation(schedule_mirror_turn(&seg, line.cast0), ((double)(n % 19) * 10.0 - 90.0) / 360.0) <
                        1e-15);
        }
    }
    free(e);
}

/* A planar head's rotor turns either way. The steps of a run are those of its pulses, one by one. */
static void steps_of_a_planar_run(void **state)
{
    (void)state;
    struct emitter *e = malloc(sizeof *e);
    for (int turn = -1; turn <= 1; turn += 2) {
        struct schedule_segment seg;
        struct schedule_line line;
        struct schedule_run run;
        emitter_set_planar(e, 36, 3, 32, 18, turn);
        const struct schedule_spec spec = {
            .prr_uhz = 360 * DEG, .lines_uhz = 10 * DEG, .sweep_udeg = TURN, .line_stop_udeg = TURN, .emitter = e};
        schedule_start(&seg, &spec);
        schedule_get_line(&seg, 2, &line);
        assert_int_equal(line.cast0, 2 * 36 + 3);
        assert_int_equal(line.cast_end, 2 * 36 + 33);
        schedule_get_run(&seg, &line, line.cast0, 30, &run);
        for (uint32_t j = 0; j < 30; j++) {
            const double pan_turn = run.pan0_turn + (run.in_line + j) * run.pan_step_turn;
            assert_true(deviation(pan_turn, turn * ((int)j - 15) / 36.0) < 4 * 0x1p-52);
            assert_true(deviation(schedule_pan_turn(&seg, line.cast0 + j), pan_turn) < 4 * 0x1p-52);
        }
    }
    free(e);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(rings_and_sectors),
        cmocka_unit_test(circles),
        cmocka_unit_test(limits_between_rings_are_refused),
        cmocka_unit_test(a_change_across_zero),
        cmocka_unit_test(a_change_keeps_the_frame),
        cmocka_unit_test(steps_of_a_planar_run),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
