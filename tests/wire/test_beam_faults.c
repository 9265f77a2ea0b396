/* SPDX-License-Identifier: MIT */
/* Faults of the beam: the effects that a native client sees, by pulse number, are those of the truth. */
#include "tests/wire/beam_run.h"

static const double RAD = M_PI / 180.0;
/* Encoders have 2^20 counts a turn. */
static const double HALF_COUNT_RAD = M_PI / 1048576.0;
/* Ranges follow from the encoders' angles. The bound is half a count of each of two axes, 3e-6 rad, seen 7 m away at 65
 * deg at most: 0.1 mm; and half a step of 0.1 mm of the range on the wire. */
static const double RANGE_M = 1.5e-4;

static int is_within(double got, double want, double tolerance)
{
    return fabs(got - want) <= tolerance;
}

static double nominal_mirror_rad(uint64_t k)
{
    const struct oracle oracle = oracle_of(&BEAM_ROOM, -40, 60, 100);
    return RAD * oracle_mirror_deg(&oracle, k);
}

static double nominal_pan_rad(uint64_t k)
{
    return RAD * 60.0 * (double)k / 20000.0;
}

/* Returns the difference of two angles of less than a turn. */
static double angle_between(double a, double b)
{
    return fabs(remainder(a - b, 2.0 * M_PI));
}

/* The range is the room's in the direction that the head reports. */
static void assert_right(const struct beam_shot *shot, uint64_t k)
{
    struct room_ray ray;
    room_cast(shot->mirror_rad, shot->pan_rad, &ray);
    if (shot->is_empty || !is_within(shot->range_m, ray.range_m, RANGE_M))
        fail_msg("pulse %" PRIu64 ": %g m, not %g m", k, shot->range_m, ray.range_m);
}

static void assert_same(const struct beam_shot *a, const struct beam_shot *b, uint64_t k)
{
    if (memcmp(a, b, offsetof(struct beam_shot, reflectance_db)) != 0 || a->t_ns != b->t_ns)
        fail_msg("pulse %" PRIu64 " is not that of the clean run", k);
}

/* The fault begins and ends where the configuration says. */
static void assert_window(const struct beam_run *run, const char *kind, uint64_t begin, uint64_t end)
{
    assert_int_equal(beam_note(run, kind, 0, 0)->pulse, begin);
    assert_int_equal(beam_note(run, kind, 0, 1)->pulse, end);
}

static void dark_shots_are_those_of_the_window(void **state)
{
    const struct beam_run *clean = beam_record(*state, 0, NULL, NULL);
    const struct beam_run *run = beam_record(*state, 1,
                                             "  - {kind: laser_off, from_pulse: 1003, until_pulse: 1003}\n"
                                             "  - {kind: laser_off, from_pulse: 2001, until_pulse: 4567}\n",
                                             NULL);
    assert_window(run, "laser_off", 1003, 1004);
    assert_int_equal(beam_note(run, "laser_off", 1, 0)->pulse, 2001);
    assert_int_equal(beam_note(run, "laser_off", 1, 1)->pulse, 4568);
    assert_int_equal(run->notes, 4);
    assert_int_equal(clean->notes, 0);
    assert_int_equal(run->pulses, 8000);
    assert_int_equal(run->lines, clean->lines);
    for (uint64_t k = 0; k < run->pulses; k++) {
        const int is_dark = k == 1003 || (k >= 2001 && k <= 4567);
        if (run->shot[k].is_empty != is_dark) fail_msg("pulse %" PRIu64 ": %s", k, is_dark ? "an echo" : "no echo");
        if (!is_dark) assert_same(&run->shot[k], &clean->shot[k], k);
        assert_true(run->shot[k].mirror_rad == clean->shot[k].mirror_rad);
    }
}

/* A window in device time goes from the first pulse that fires in it to the last one before its end. */
static void windows_in_time_are_exact_to_the_pulse(void **state)
{
    const struct beam_run *first = beam_record(*state, 0, "  - {kind: laser_off}\n", NULL);
    const int64_t zero_ns = beam_note(first, "laser_off", 0, 0)->t_ns; /* of pulse 0 */
    char faults[160];
    assert_window(first, "laser_off", 0, 8000);
    assert_int_equal(first->start_ns, zero_ns);
    /* Pulses are 50 us apart. 0.1 s and 10 ns later is after pulse 2000; its end is at pulse 2345. */
    snprintf(faults, sizeof faults, "  - {kind: laser_off, from_s: %.9f, until_s: %.9f}\n",
             1e-9 * (double)(zero_ns + 100000010), 1e-9 * (double)(zero_ns + 2345 * 50000));
    const struct beam_run *run = beam_record(*state, 1, faults, NULL);
    const int64_t later_ns = run->start_ns - zero_ns;
    assert_int_equal(later_ns % 50000, 0);
    const uint64_t from = (uint64_t)(2001 - later_ns / 50000), until = from + 2345 - 2001;
    assert_window(run, "laser_off", from, until);
    for (uint64_t k = 0; k < run->pulses; k++)
        assert_int_equal(run->shot[k].is_empty, k >= from && k < until);
    const struct beam_note *note = beam_note(run, "laser_off", 0, 0);
    assert_int_equal(note->t_ns, run->start_ns + run->shot[from].t_ns);
}

/* The speed is half from pulse 1003 to 5008. Then a pulse moves the phase by 1/800 of a line, else by 1/400. */
static double slow_mirror_rad(uint64_t k)
{
    const uint64_t before = k < 1003 ? k : 1003, after = k < 5009 ? 0 : k - 5009;
    const uint64_t eight_hundredths = 2 * (before + after) + (k - before - after);
    return RAD * (-40.0 + 100.0 * (double)(eight_hundredths % 800) / 800.0);
}

static void a_slow_mirror_shows_in_line_ends_and_encoders(void **state)
{
    const struct beam_run *run =
        beam_record(*state, 1, "  - {kind: mirror_slow, factor: 0.5, from_pulse: 1003, until_pulse: 5008}\n", NULL);
    uint32_t slow = 0, right = 0;
    assert_window(run, "mirror_slow", 1003, 5009);
    assert_true(run->info.lines_hz == 50.0 && run->info.prr_hz == 20000.0);
    for (uint64_t k = 0; k < run->pulses; k++) {
        const struct beam_shot *shot = &run->shot[k];
        if (angle_between(shot->mirror_rad, slow_mirror_rad(k)) > HALF_COUNT_RAD + 1e-12)
            fail_msg("pulse %" PRIu64 ": mirror %.6f deg", k, shot->mirror_rad / RAD);
        assert_true(angle_between(shot->pan_rad, nominal_pan_rad(k)) <= HALF_COUNT_RAD + 1e-12);
        assert_int_equal(shot->t_ns, (int64_t)k * 50000);
        assert_right(shot, k);
    }
    for (uint32_t i = 0; i < run->lines; i++) {
        const struct scanhead_line_end *line = &run->line[i];
        const uint64_t end = line->pulse0 + line->n_fired;
        const int is_slow = line->pulse0 >= 1003 && end <= 5009, is_right = end <= 1003 || line->pulse0 >= 5009;
        assert_int_equal(line->t1_ns - line->t0_ns, (int64_t)line->n_fired * 50000);
        assert_int_equal(line->n_cast, line->n_fired);
        if (is_slow) assert_int_equal(line->n_fired, 800); /* 20000 Hz / (50 / 2) lines per second */
        if (is_right) assert_int_equal(line->n_fired, 400);
        slow += (uint32_t)is_slow;
        right += (uint32_t)is_right;
    }
    assert_int_equal(run->line[run->lines - 1].status, 1); /* the frame ends with a line, where the pan has its stop */
    assert_in_range(run->pulses, 8000, 8400);
    assert_in_range(slow, 4, 5);
    assert_true(right >= 9);
}

static void a_stuck_mirror_reads_one_angle(void **state)
{
    const struct beam_run *clean = beam_record(*state, 0, NULL, NULL);
    const struct beam_run *run =
        beam_record(*state, 1, "  - {kind: mirror_stuck, from_pulse: 1003, until_pulse: 5008}\n", NULL);
    assert_window(run, "mirror_stuck", 1003, 5009);
    for (uint64_t k = 0; k < run->pulses; k++) {
        const struct beam_shot *shot = &run->shot[k];
        const int stands = k >= 1003 && k < 5009;
        if (stands != (shot->mirror_rad == clean->shot[1003].mirror_rad) && k % 400 != 1003 % 400)
            fail_msg("pulse %" PRIu64 ": %s", k, stands ? "the mirror moves" : "the mirror stands");
        if (!stands) assert_same(shot, &clean->shot[k], k);
        assert_true(shot->pan_rad == clean->shot[k].pan_rad && shot->t_ns == clean->shot[k].t_ns);
        assert_right(shot, k);
    }
    /* Lines go on by time. */
    const uint32_t stuck = (uint32_t)lround(run->shot[1003].mirror_rad / (2.0 * M_PI) * 1048576.0) & 1048575;
    assert_int_equal(run->lines, clean->lines);
    for (uint32_t i = 0; i < run->lines; i++) {
        const uint64_t last = run->line[i].pulse0 + run->line[i].n_fired - 1;
        const int stands = last >= 1003 && last < 5009;
        assert_int_equal(run->line[i].pulse0, clean->line[i].pulse0);
        assert_int_equal(run->line[i].n_fired, clean->line[i].n_fired);
        assert_int_equal(run->line[i].mirror_count, stands ? stuck : clean->line[i].mirror_count);
    }
}

static void a_wobble_is_what_the_encoder_reads(void **state)
{
    const struct beam_run *run = beam_record(
        *state, 1, "  - {kind: mirror_wobble, deg: 0.7, hz: 37.5, from_pulse: 1003, until_pulse: 5008}\n", NULL);
    const double begin_s = 1e-9 * (double)run->shot[1003].t_ns;
    assert_window(run, "mirror_wobble", 1003, 5009);
    for (uint64_t k = 0; k < run->pulses; k++) {
        const struct beam_shot *shot = &run->shot[k];
        const double since_s = 1e-9 * (double)shot->t_ns - begin_s;
        const double by_rad = k >= 1003 && k < 5009 ? 0.7 * RAD * sin(2.0 * M_PI * 37.5 * since_s) : 0.0;
        if (angle_between(shot->mirror_rad, nominal_mirror_rad(k) + by_rad) > HALF_COUNT_RAD + 1e-12)
            fail_msg("pulse %" PRIu64 ": mirror %.6f deg", k, shot->mirror_rad / RAD);
        assert_right(shot, k);
    }
}

/* The stream does not show it; only the walls are in wrong places. */
static void a_slipped_pan_moves_the_points_alone(void **state)
{
    const struct beam_run *clean = beam_record(*state, 0, NULL, NULL);
    const struct beam_run *run =
        beam_record(*state, 1, "  - {kind: pan_slip, deg: 2.5, from_pulse: 1003, until_pulse: 5008}\n", NULL);
    double most_m = 0.0;
    assert_window(run, "pan_slip", 1003, 5009);
    assert_int_equal(run->pulses, clean->pulses);
    for (uint64_t k = 0; k < run->pulses; k++) {
        struct beam_shot shot = run->shot[k];
        assert_true(shot.mirror_rad == clean->shot[k].mirror_rad && shot.pan_rad == clean->shot[k].pan_rad);
        most_m = fmax(most_m, fabs(shot.range_m - clean->shot[k].range_m));
        if (k >= 1003 && k < 5009)
            shot.pan_rad += 2.5 * RAD;
        else
            assert_same(&shot, &clean->shot[k], k);
        assert_right(&shot, k);
    }
    assert_true(most_m > 0.05);
    for (uint32_t i = 0; i < run->lines; i++)
        assert_int_equal(run->line[i].pan_count, clean->line[i].pan_count);
}

static const char SOILED[] = "  - {kind: window_soiled, loss_db: 4.25, from_pulse: 1003, until_pulse: 5008}\n";

/* Each of the two values is rounded to 0.01 dB on the wire, so they differ by a step at most. The profile's range on a
 * dark wall is 1 km, so nothing vanishes. */
static void a_soiled_window_takes_its_decibels(void **state)
{
    static const char *const sets[] = {"signal.model=on", "signal.detection=sharp", "output.attributes=on", NULL};
    const struct beam_run *clean = beam_record(*state, 0, NULL, sets), *run = beam_record(*state, 1, SOILED, sets);
    assert_window(run, "window_soiled", 1003, 5009);
    for (uint64_t k = 0; k < run->pulses; k++) {
        const struct beam_shot *shot = &run->shot[k], *was = &clean->shot[k];
        const double loss_db = k >= 1003 && k < 5009 ? 4.25 : 0.0;
        if (!is_within(was->amplitude_db - shot->amplitude_db, loss_db, 0.01 + 1e-9) ||
            !is_within(was->reflectance_db - shot->reflectance_db, loss_db, 0.01 + 1e-9))
            fail_msg("pulse %" PRIu64 ": %g dB, not %g dB", k, shot->amplitude_db, was->amplitude_db);
        assert_true(shot->range_m == was->range_m);
    }
}

/* Without a signal model the noise is 10^(4.25 / 10) times as large, and otherwise the same. Each range is
 * also rounded by up to half a count. */
static void a_soiled_window_makes_ranges_noisy(void **state)
{
    static const char *const off[] = {"noise.range=off", NULL}, *const on[] = {"noise.range=on", NULL};
    static double true_m[BEAM_MAX_PULSES];
    const struct beam_run *run = beam_record(*state, 0, NULL, off);
    for (uint64_t k = 0; k < run->pulses; k++)
        true_m[k] = run->shot[k].range_m;
    const struct beam_run *clean = beam_record(*state, 0, NULL, on);
    run = beam_record(*state, 1, SOILED, on);
    for (uint64_t k = 0; k < run->pulses; k++) {
        const double grows = k >= 1003 && k < 5009 ? pow(10.0, 0.425) : 1.0;
        const double was_m = clean->shot[k].range_m - true_m[k], is_m = run->shot[k].range_m - true_m[k];
        /* Three ranges have steps of 1e-4 m. The error of the true one counts |grows - 1| times. */
        if (!is_within(is_m, grows * was_m, 0.5e-4 * (1.0 + grows + fabs(grows - 1.0)) + 1e-9))
            fail_msg("pulse %" PRIu64 ": %g m, not %g * %g m", k, is_m, grows, was_m);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(dark_shots_are_those_of_the_window),
        cmocka_unit_test(windows_in_time_are_exact_to_the_pulse),
        cmocka_unit_test(a_slow_mirror_shows_in_line_ends_and_encoders),
        cmocka_unit_test(a_stuck_mirror_reads_one_angle),
        cmocka_unit_test(a_wobble_is_what_the_encoder_reads),
        cmocka_unit_test(a_slipped_pan_moves_the_points_alone),
        cmocka_unit_test(a_soiled_window_takes_its_decibels),
        cmocka_unit_test(a_soiled_window_makes_ranges_noisy),
    };
    return cmocka_run_group_tests(tests, wire_setup, wire_teardown);
}
