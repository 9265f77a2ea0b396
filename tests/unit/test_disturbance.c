/* SPDX-License-Identifier: MIT */
/* Casts of heads with a fault. A head whose pan slipped casts as one whose pan began elsewhere, but its encoders don't
 * show it. A soiled window is a weaker signal. */
#include "tests/unit/cast_rig.h"

#include "core/angle.h"
#include "core/pose.h"

static const double LO[3] = {-4.0, -6.0, -1.5}, HI[3] = {5.0, 7.0, 2.5}, CENTRE[3] = {0.0, 0.0, 0.0};
enum { SLIP_UDEG = 2500000, LINE = 3 };

/* A line of three heads: the tested one, the same with a slipped pan, and the same whose pan began so much further. */
struct three {
    struct line_block clean, slipped, turned;
};

static void keep(struct cast_rig *rig, struct line_block *to)
{
    struct schedule_line line;
    struct sh_err err;
    assert_int_equal(line_block_alloc(to, RIG_LINE, &err), SH_OK);
    cast_line(rig, LINE, &line);
    to->n_points = rig->block.n_points;
    memcpy(to->a, rig->block.a, RIG_LINE * sizeof *to->a);
    memcpy(to->b, rig->block.b, RIG_LINE * sizeof *to->b);
    memcpy(to->c, rig->block.c, RIG_LINE * sizeof *to->c);
}

static void cast_three(struct cast_rig *rig, struct three *t)
{
    const struct cast_disturbance disturbance = {.slip_turn = SLIP_UDEG / 360e6, .share = 1.0};
    keep(rig, &t->clean);
    rig->setup.disturbance = &disturbance;
    keep(rig, &t->slipped);
    rig->setup.disturbance = NULL;
    rig->spec.pan_start_udeg += SLIP_UDEG;
    schedule_start(&rig->segment, &rig->spec);
    keep(rig, &t->turned);
}

static void free_three(struct three *t)
{
    line_block_free(&t->clean);
    line_block_free(&t->slipped);
    line_block_free(&t->turned);
}

/* Ranges are counts of 1e-5 m. Directions that differ in their last bit may round to the next count. */
static void slip_is_what_nobody_reads(struct cast_rig *rig)
{
    struct three t;
    uint32_t moved = 0;
    cast_three(rig, &t);
    assert_true(t.slipped.n_points == t.clean.n_points && t.slipped.n_points > 2000);
    for (uint32_t i = 0; i < t.clean.n_points; i++) {
        assert_int_equal(t.slipped.b[i], t.clean.b[i]);
        assert_int_equal(t.slipped.c[i], t.clean.c[i]);
        assert_true(abs((int)(t.slipped.a[i] - t.turned.a[i])) <= 1);
        moved += abs((int)(t.slipped.a[i] - t.clean.a[i])) > 100; /* 1 mm */
    }
    /* Floor and ceiling are as far away in any pan. Walls fill a tenth of a line. */
    assert_true(moved > t.clean.n_points / 20);
    free_three(&t);
    cast_rig_close(rig);
}

static void set_knots(struct cast_rig *rig, struct pose_knot knot[2])
{
    for (int i = 0; i < 2; i++) {
        knot[i] = (struct pose_knot){.t_ns = 100000000 * i, .pose.position_m = {0.5 * i, -0.2, 0.1 * i}};
        pose_from_angles(0.3 + i, 0.2 * i, -0.1, knot[i].pose.quat);
    }
    rig->setup.knot = knot;
    rig->setup.n_knots = 2;
}

enum { LEVEL, TILTED, MOVING };

static void a_slipped_pan_of_any_head(void **state)
{
    (void)state;
    /* The encoders' errors are the same, wherever the beam goes. */
    const struct instrument bent = {.collimation_rad = 0.02,
                                    .trunnion_rad = -0.01,
                                    .transit_offset_m = 0.05,
                                    .mirror_offset_m = 0.03,
                                    .pan = {.index_rad = 0.1, .eccentricity_rad = 0.003}};
    const struct cast_detect detect = {.instrument = &bent, .max_echoes = 1};
    /* A tilt and a turn about the head's own axis don't commute: the pan slips within the head. */
    for (int stands = LEVEL; stands <= MOVING; stands++)
        for (int is_bent = 0; is_bent < 2; is_bent++) {
            struct cast_rig *rig = cast_rig_open(box_scene(LO, HI), CENTRE);
            struct pose_knot knot[2];
            if (stands == TILTED) pose_attitude(0.3, 0.2, -0.1, rig->setup.rotation);
            if (stands == MOVING) set_knots(rig, knot);
            if (is_bent) rig->setup.detect = &detect;
            slip_is_what_nobody_reads(rig);
        }
}

/* Positions follow the encoders: range times direction. Position and range are each rounded by half a count of 1e-5 m.
 * 2^-32 of a turn moves 9 m by 7e-9 m. */
static void positions_follow_the_encoders(void **state)
{
    (void)state;
    struct cast_rig *rig = cast_rig_open(box_scene(LO, HI), CENTRE);
    const struct cast_disturbance disturbance = {.slip_turn = 0.01,
                                                 .share = 1.0,
                                                 .n_wobbles = 2,
                                                 .wobble = {{.mirror_turn = 0.02, .hz = 90.0, .begin_ns = 12345},
                                                            {.pan_turn = 0.03, .hz = 45.0, .begin_ns = -99999}}};
    struct line_block polar, geo;
    rig->setup.disturbance = &disturbance;
    keep(rig, &polar);
    rig->setup.layout = LINE_GEO;
    keep(rig, &geo);
    for (uint32_t i = 0; i < polar.n_points; i++) {
        long double d[3];
        const int32_t at[3] = {(int32_t)geo.a[i], (int32_t)geo.b[i], (int32_t)geo.c[i]};
        true_direction(0x1p-32L * polar.b[i], 0x1p-32L * polar.c[i], 0.0L, d);
        for (int k = 0; k < 3; k++)
            assert_true(fabsl((long double)polar.a[i] * d[k] - at[k]) < 1.01L);
    }
    line_block_free(&polar);
    line_block_free(&geo);
    cast_rig_close(rig);
}

/* A = (6 m / R)^2 through a clean window, for a white wall that is seen to 6 m. Through one that transmits half, walls
 * are seen to 6 m / sqrt 2, and the jitter of the seen ones is twice as large: the same numbers are drawn. */
static void a_soiled_window_is_a_weaker_signal(void **state)
{
    (void)state;
    const struct detect_signal_spec spec = {.n_reaches = 1,
                                            .reach = {{1.0, 6.0}},
                                            .threshold_snr = 10.0,
                                            .sharp = 1,
                                            .sigma_m = 0.01,
                                            .sigma_at_m = 6.0,
                                            .sigma_reflectance = 1.0,
                                            .seed = 7};
    struct cast_rig *rig = cast_rig_open(box_scene(LO, HI), CENTRE);
    const struct cast_disturbance disturbance = {.share = 0.5};
    struct detect_signal signal;
    struct sh_err err;
    assert_int_equal(detect_signal_set_up(&spec, &signal, &err), SH_OK);
    struct cast_detect detect = {.signal = &signal, .max_echoes = 1};
    struct line_block exact, seen, clean, soiled;
    keep(rig, &exact);
    rig->setup.detect = &detect;
    rig->setup.disturbance = &disturbance;
    keep(rig, &seen);
    detect.noise_by_signal = 1;
    keep(rig, &soiled);
    rig->setup.disturbance = NULL;
    keep(rig, &clean);
    uint32_t n = 0, gone = 0;
    for (uint32_t i = 0; i < exact.n_points; i++) {
        const double range_m = 1e-5 * exact.a[i], noise_m = 1e-5 * ((double)clean.a[i] - exact.a[i]);
        if (fabs(range_m - 6.0 / sqrt(2.0)) < 1e-5 || fabs(range_m - 6.0) < 1e-5) continue;
        assert_int_equal(seen.a[i] != 0, range_m < 6.0 / sqrt(2.0));
        assert_int_equal(clean.a[i] != 0, range_m < 6.0);
        gone += clean.a[i] != 0 && soiled.a[i] == 0;
        if (soiled.a[i] == 0) continue;
        /* three counts of 1e-5 m are rounded by a half; their weights are 1, 2 and 2 - 1 */
        assert_true(fabs(1e-5 * ((double)soiled.a[i] - exact.a[i]) - 2.0 * noise_m) <= 2.01e-5);
        n += fabs(noise_m) > 1e-3;
    }
    assert_true(n > 200 && gone > 100);
    line_block_free(&exact);
    line_block_free(&seen);
    line_block_free(&clean);
    line_block_free(&soiled);
    cast_rig_close(rig);
}

/* Without a model of the signal the fixed part of the noise grows by 1 / share. The same numbers are drawn, four times
 * as large through a window that transmits a quarter. Counts of 1e-5 m are rounded by a half; their weights are 1, 4
 * and 3. */
static void a_soiled_window_makes_ranges_noisy(void **state)
{
    (void)state;
    struct cast_rig *rig = cast_rig_open(box_scene(LO, HI), CENTRE);
    const struct cast_disturbance disturbance = {.share = 0.25};
    struct line_block exact, clean, soiled;
    uint32_t n = 0;
    keep(rig, &exact);
    rig->setup.noise_on = 1;
    rig->setup.range_sigma_m = 0.003;
    rig->setup.noise_key = rng_key(1, RNG_RANGE);
    keep(rig, &clean);
    rig->setup.disturbance = &disturbance;
    keep(rig, &soiled);
    for (uint32_t i = 0; i < exact.n_points; i++) {
        const double noise_m = 1e-5 * ((double)clean.a[i] - exact.a[i]);
        assert_true(fabs(1e-5 * ((double)soiled.a[i] - exact.a[i]) - 4.0 * noise_m) <= 4.01e-5);
        n += fabs(noise_m) > 1e-3;
    }
    assert_true(n > 1000);
    line_block_free(&exact);
    line_block_free(&clean);
    line_block_free(&soiled);
    cast_rig_close(rig);
}

/* A wobble is a sine from its begin on: 0 there, full after a quarter of a period, and minus that after three. */
static void a_wobble_begins_at_rest(void **state)
{
    (void)state;
    const struct cast_disturbance disturbance = {
        .share = 1.0,
        .n_wobbles = 2,
        .wobble = {{.mirror_turn = 0.02, .pan_turn = 0.03, .hz = 2.0, .begin_ns = 1000},
                   {.mirror_turn = 0.5, .pan_turn = 0.25, .hz = 4.0, .begin_ns = 1000}}};
    static const double wave[] = {0.0, 1.0, 0.0, -1.0, 0.0};
    for (int k = 0; k < 5; k++) { /* the second one is back at rest at each of these */
        double mirror_turn = 0.1, pan_turn = 0.2;
        cast_wobble(&disturbance, 1000 + 125000000 * (int64_t)k, &mirror_turn, &pan_turn);
        assert_true(fabs(mirror_turn - 0.1 - 0.02 * wave[k]) < 1e-14);
        assert_true(fabs(pan_turn - 0.2 - 0.03 * wave[k]) < 1e-14);
    }
}

/* The laser is dark: all shots are empty, and the encoders still read. */
static void a_dark_laser_has_no_echo(void **state)
{
    (void)state;
    struct cast_rig *rig = cast_rig_open(box_scene(LO, HI), CENTRE);
    const struct cast_disturbance disturbance = {.dark = 1, .share = 1.0};
    struct line_block clean, dark;
    struct schedule_line line;
    keep(rig, &clean);
    rig->setup.disturbance = &disturbance;
    keep(rig, &dark);
    assert_int_equal(cast_line(rig, LINE, &line), 0);
    for (uint32_t i = 0; i < clean.n_points; i++) {
        assert_true(clean.a[i] > 0 && dark.a[i] == 0 && dark.b[i] == clean.b[i] && dark.c[i] == clean.c[i]);
        assert_true(rig->block.echo[i] == 0 && rig->block.label[i] == LINE_LABEL_NONE);
    }
    line_block_free(&clean);
    line_block_free(&dark);
    cast_rig_close(rig);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_slipped_pan_of_any_head),
        cmocka_unit_test(positions_follow_the_encoders),
        cmocka_unit_test(a_soiled_window_is_a_weaker_signal),
        cmocka_unit_test(a_soiled_window_makes_ranges_noisy),
        cmocka_unit_test(a_wobble_begins_at_rest),
        cmocka_unit_test(a_dark_laser_has_no_echo),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
