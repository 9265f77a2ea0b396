/* SPDX-License-Identifier: MIT */
/* Hits that are found ahead: which pulses take them, which setups have them, how many there are. Two boxes, one around
 * the other, tell a hit that was found ahead from one that the cast itself finds. */
#include "tests/unit/cast_rig.h"

#include "core/instrument.h"

enum { LINE_PULSES = 1000, CAST = 600 };
static const double NEAR_LO[3] = {-2, -2, -2}, NEAR_HI[3] = {2, 2, 2}, FAR_LO[3] = {-9, -9, -9}, FAR_HI[3] = {9, 9, 9};

struct two_boxes {
    struct cast_rig *near, *far; /* the far one's caster and block are used */
};

static struct two_boxes open_boxes(uint32_t room)
{
    static const double station_m[3] = {0};
    const struct two_boxes b = {cast_rig_open(box_scene(NEAR_LO, NEAR_HI), station_m),
                                cast_rig_open(box_scene(FAR_LO, FAR_HI), station_m)};
    struct sh_err err;
    b.far->spec = (struct schedule_spec){.prr_uhz = 100 * LINE_PULSES * HZ,
                                         .lines_uhz = 100 * HZ,
                                         .pan_udeg_s = 16 * DEG,
                                         .fov_min_udeg = -50 * DEG,
                                         .sweep_udeg = 160 * DEG,
                                         .line_start_udeg = -50 * DEG,
                                         .line_stop_udeg = 46 * DEG - 1,
                                         .pan_stop_udeg = 360 * DEG};
    schedule_start(&b.far->segment, &b.far->spec);
    if (room != 0 && caster_add_ahead(b.far->caster, room, &err) != 0) fail_msg("%s", err.text);
    return b;
}

static void close_boxes(const struct two_boxes *b)
{
    cast_rig_close(b->near);
    cast_rig_close(b->far);
}

static struct schedule_run run_of(const struct two_boxes *b, uint64_t line, uint64_t first, uint64_t end)
{
    struct schedule_line at;
    struct schedule_run run;
    schedule_get_line(&b->far->segment, line, &at);
    assert_int_equal(at.cast_end - at.cast0, CAST);
    schedule_get_run(&b->far->segment, &at, at.cast0 + first, (uint32_t)(end - first), &run);
    return run;
}

/* Finds hits in the near box ahead. */
static void look_ahead(const struct two_boxes *b, const struct schedule_run *run, uint32_t n)
{
    assert_true(caster_room_ahead(b->far->caster, &b->near->setup, NULL) != 0);
    caster_look_ahead(b->far->caster, &b->near->setup, run, n);
}

/* Casts in the far box. Returns whether hits were found ahead, as ranges tell: up to 2 sqrt(3) m to walls at 2 m, and
 * from 9 m on to walls at 9 m. All pulses of a piece of a line are of one kind. */
static int is_ahead(const struct two_boxes *b, uint64_t line, uint64_t first, uint64_t end)
{
    const struct schedule_run run = run_of(b, line, first, end);
    const double least = 2.0 / b->far->setup.range_scale_m, most = 2.0 * sqrt(3.0) / b->far->setup.range_scale_m;
    uint32_t n_near = 0;
    assert_int_equal(caster_cast(b->far->caster, &b->far->setup, &run, &b->far->block), end - first);
    for (uint32_t i = 0; i < run.n; i++) {
        const double range = (double)b->far->block.a[i];
        assert_true(range >= least - 1.0 && (range <= most + 1.0 || range >= 4.5 * least - 1.0));
        n_near += range <= most + 1.0;
    }
    assert_true(n_near == 0 || n_near == run.n);
    return n_near != 0;
}

static void test_pulses_take_hits(void **state)
{
    const struct two_boxes b = open_boxes(4 * CAST);
    const struct schedule_run run[4] = {run_of(&b, 3, 200, CAST), run_of(&b, 4, 0, CAST), run_of(&b, 5, 0, CAST),
                                        run_of(&b, 6, 0, 150)};
    (void)state;
    assert_false(is_ahead(&b, 4, 0, CAST));
    look_ahead(&b, run, 4);
    assert_false(is_ahead(&b, 3, 0, 200));
    assert_true(is_ahead(&b, 3, 200, CAST));
    assert_true(is_ahead(&b, 4, 0, CAST));
    assert_true(is_ahead(&b, 4, 599, CAST));
    assert_true(is_ahead(&b, 5, 37, 101));
    assert_true(is_ahead(&b, 6, 0, 150));
    assert_false(is_ahead(&b, 6, 0, 151)); /* not all of this chunk is known */
    assert_false(is_ahead(&b, 6, 150, CAST));
    assert_false(is_ahead(&b, 7, 0, CAST));
    caster_forget(b.far->caster);
    assert_false(is_ahead(&b, 4, 0, CAST));
    close_boxes(&b);
}

/* Lines are close together or far apart: tiles of four or eight pulses of a line. Ranges are those of the box. */
static void test_ranges_of_each_tile(void **state)
{
    static const int64_t pan_udeg_s[] = {0, 16 * DEG, 40 * DEG, 2000 * DEG};
    (void)state;
    for (size_t p = 0; p < sizeof pan_udeg_s / sizeof pan_udeg_s[0]; p++) {
        const struct two_boxes b = open_boxes(CAST_AHEAD_RUNS * CAST);
        struct schedule_run run[CAST_AHEAD_RUNS];
        b.far->spec.pan_udeg_s = pan_udeg_s[p];
        if (pan_udeg_s[p] == 0) b.far->spec.pan_stop_udeg = 0;
        schedule_start(&b.far->segment, &b.far->spec);
        for (uint32_t q = 0; q < CAST_AHEAD_RUNS; q++)
            run[q] = run_of(&b, 1 + q, 11 * q, CAST - 7 * q);
        look_ahead(&b, run, CAST_AHEAD_RUNS);
        for (uint32_t q = 0; q < CAST_AHEAD_RUNS; q++) {
            assert_true(is_ahead(&b, 1 + q, 11 * q, CAST - 7 * q));
            for (uint32_t i = 0; i < run[q].n; i++) {
                static const double station_m[3] = {0};
                long double mirror, pan, d[3];
                int wall;
                true_angles(&b.far->spec, run[q].pulse0 + i, &mirror, &pan);
                true_direction(mirror, pan, 0.0L, d);
                const long double range = box_range(NEAR_LO, NEAR_HI, station_m, d, &wall);
                /* half a count, and a double's rounding */
                assert_true(fabsl((long double)b.far->block.a[i] * b.far->setup.range_scale_m - range) <=
                            0.50001L * b.far->setup.range_scale_m);
            }
        }
        close_boxes(&b);
    }
}

/* Runs that do not fit are left out. */
static void test_room(void **state)
{
    const struct two_boxes b = open_boxes(2 * CAST + 100);
    const struct schedule_run run[3] = {run_of(&b, 1, 0, CAST), run_of(&b, 2, 0, CAST), run_of(&b, 3, 0, 101)},
                              fit[3] = {run[0], run[1], run_of(&b, 3, 0, 100)};
    (void)state;
    look_ahead(&b, run, 3);
    assert_true(is_ahead(&b, 2, 0, CAST));
    assert_false(is_ahead(&b, 3, 0, 50));
    look_ahead(&b, fit, 3);
    assert_true(is_ahead(&b, 3, 0, 100));
    close_boxes(&b);
}

static void test_setups(void **state)
{
    const struct two_boxes b = open_boxes(777), none = open_boxes(0);
    const struct cast_setup plain = b.near->setup;
    struct instrument bent = {.collimation_rad = 1e-3}, offset = {.transit_offset_m = 0.02};
    struct cast_detect detect = {.instrument = &bent, .max_echoes = 1};
    const struct cast_disturbance slip = {.slip_turn = 0.01, .share = 1.0};
    struct cast_beam beam = {.mode = BEAM_ADAPTIVE};
    const struct emitter sphere = {.kind = EMITTER_SPHERE};
    struct cast_setup s = plain;
    (void)state;
    assert_int_equal(caster_room_ahead(b.far->caster, &s, NULL), 777);
    assert_int_equal(caster_room_ahead(none.far->caster, &s, NULL), 0);
    assert_int_equal(caster_room_ahead(b.far->caster, &s, &sphere), 0);
    s.detect = &detect;
    assert_int_equal(caster_room_ahead(b.far->caster, &s, NULL), 777);
    detect.instrument = &offset;
    assert_int_equal(caster_room_ahead(b.far->caster, &s, NULL), 0);
    detect.instrument = NULL;
    s.beam = &beam;
    assert_int_equal(caster_room_ahead(b.far->caster, &s, NULL), 777);
    beam.mode = BEAM_RINGS;
    assert_int_equal(caster_room_ahead(b.far->caster, &s, NULL), 0);
    s = plain;
    s.disturbance = &slip;
    assert_int_equal(caster_room_ahead(b.far->caster, &s, NULL), 0);
    s = plain;
    s.n_knots = 2;
    assert_int_equal(caster_room_ahead(b.far->caster, &s, NULL), 0);
    close_boxes(&b);
    close_boxes(&none);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_pulses_take_hits),
                                       cmocka_unit_test(test_ranges_of_each_tile), cmocka_unit_test(test_room),
                                       cmocka_unit_test(test_setups)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
