/* SPDX-License-Identifier: MIT */
/* Glass and mirrors, compared with rooms whose images can be worked out; and detection that changes nothing. */
#include "tests/unit/optics_rig.h"

#include "core/colour.h"
#include "core/surface.h"
#include "tests/common/made.h"

/* The wall ahead is a mirror. The room continues in it as its own image, and each ray goes on as if there were no
 * mirror. */
static void a_mirror_shows_the_room_behind_it(void **state)
{
    (void)state;
    struct optics o;
    struct schedule_line line;
    open_optics(&o, box_scene(LO, HI));
    o.table.surface[3] = (struct surface){.mirror = 0.9};
    o.table.has_optics = 1;
    const double far[3] = {HI[0], 2.0 * HI[1] - LO[1], HI[2]};
    uint32_t n = shoot_line(&o, 40, &line), ghosts = 0;
    assert_int_equal(o.rig->block.n_points, n); /* a clean mirror has no echo of its own */
    for (uint32_t i = 0; i < n; i++) {
        long double d[3];
        int wall = -1, image = -1;
        direction(o.rig, &line, i, d);
        long double plain = box_range(LO, HI, STATION, d, &wall), folded = box_range(LO, far, STATION, d, &image);
        assert_int_equal(o.rig->block.echo[i], 0x11);
        near_range(o.rig, i, wall == 3 ? folded : plain);
        assert_int_equal(o.rig->block.label[i], wall != 3 ? wall : 6 + (image == 3 ? 2 : image));
        ghosts += wall == 3;
    }
    assert_true(ghosts > 500 && ghosts < n - 500);
    close_optics(&o);
}

/* Two mirrors face each other. Their images go on for ever, and a pulse is followed through four. */
static void facing_mirrors_end_at_the_depth(void **state)
{
    (void)state;
    struct optics o;
    struct schedule_line line;
    open_optics(&o, box_scene(LO, HI));
    o.table.surface[2] = o.table.surface[3] = (struct surface){.mirror = 1.0};
    o.table.has_optics = 1;
    const double lo[3] = {LO[0], -INFINITY, LO[2]}, hi[3] = {HI[0], INFINITY, HI[2]};
    uint32_t n = shoot_line(&o, 5, &line), lost = 0, most = 0;
    for (uint32_t i = 0; i < n; i++) {
        long double d[3];
        int wall = -1;
        direction(o.rig, &line, i, d);
        long double range = box_range(lo, hi, STATION, d, &wall);
        double y = STATION[1] + (double)(range * d[1]);
        uint32_t mirrors = (uint32_t)(fabs(y) + 5.0) / 10; /* walls at +-5, 15, 25 ... m */
        assert_int_equal(o.rig->block.echo[i], mirrors > 4 ? 0 : 0x11);
        if (mirrors > 4)
            lost++;
        else
            near_range(o.rig, i, range);
        if (mirrors <= 4 && mirrors > most) most = mirrors;
        if (mirrors <= 4) assert_int_equal(o.rig->block.label[i], wall + (mirrors > 0 ? 6 : 0));
    }
    assert_true(most == 4 && lost > 10);
    close_optics(&o);
}

/* A pane before a wall, and a signal for it. */
static void open_window(struct optics *o, struct detect_signal *signal)
{
    struct sh_err err;
    const struct detect_signal_spec spec = {.n_reaches = 1, .reach = {{0.9, 900.0}}, .threshold_snr = 8.0, .sharp = 1};
    assert_int_equal(detect_signal_set_up(&spec, signal, &err), SH_OK);
    open_optics(o, window());
    o->table.surface[0] = (struct surface){.reflectance = 0.05, .glass = 0.9};
    o->table.surface[1] = (struct surface){.reflectance = 0.6};
    o->table.has_optics = 1;
}

/* There are three echoes: both sides of the pane, and the wall, whose light passes four sides. Only the middle of the
 * line has them. When fewer are asked for, the weakest is left out: the pane's far side, then its near one. */
static void a_pane_and_what_is_behind_it(void **state)
{
    (void)state;
    struct optics o;
    struct schedule_line line;
    struct detect_signal signal;
    open_window(&o, &signal);
    for (int with_signal = 0; with_signal < 2; with_signal++)
        for (uint32_t most = 1; most <= 3; most++) {
            o.detect.signal = with_signal ? &signal : NULL;
            o.detect.max_echoes = most;
            schedule_get_line(&o.rig->segment, 0, &line);
            uint64_t k = line.cast0 + 10; /* -39.2 deg on */
            uint32_t echoes = cast_some(o.rig, &line, k, 1000);
            assert_int_equal(echoes, 1000 * most);
            assert_int_equal(o.rig->block.n_points, 1000 * most);
            assert_int_equal(o.rig->block.n_pulses, 1000);
            for (uint32_t i = 0; i < 1000 * most; i++) {
                static const double y[] = {2.0, 2.004, 5.0}, rho[] = {0.05, 0.05 * 0.81, 0.6 * 0.6561};
                static const uint32_t sent[3][3] = {{2}, {0, 2}, {0, 1, 2}};
                uint32_t pulse = i / most, number = sent[most - 1][i % most];
                long double d[3];
                direction(o.rig, &line, 10 + pulse, d);
                assert_int_equal(o.rig->block.echo[i], (i % most + 1) | most << 4);
                assert_int_equal(o.rig->block.label[i], number == 2);
                near_range(o.rig, i, ((long double)y[number] - (long double)STATION[1]) / d[1]);
                assert_true(o.rig->block.t0_ns + o.rig->block.dt_ns[i] == schedule_time_ns(&o.rig->segment, k + pulse));
                double cdb = 1000.0 * log10(rho[number] * (double)d[1]);
                assert_true(with_signal ? fabs(o.rig->block.refl_cdb[i] - cdb) < 0.51
                                        : o.rig->block.refl_cdb[i] == LINE_REFL_NONE);
            }
        }
    close_optics(&o);
}

/* With a range resolution of 10 cm both sides of the pane make one echo. Its light is their sum, and its range is their
 * mean, weighted by light. The wall stays separate. With a resolution of 1 mm there are three. */
static void what_is_too_near_is_one_echo(void **state)
{
    (void)state;
    struct optics o;
    struct schedule_line line;
    struct detect_signal signal;
    open_window(&o, &signal);
    o.detect.signal = &signal;
    schedule_get_line(&o.rig->segment, 0, &line);
    o.detect.separation_m = 0.001;
    assert_int_equal(cast_some(o.rig, &line, line.cast0 + 10, 1000), 3000);
    o.detect.separation_m = 0.1;
    assert_int_equal(cast_some(o.rig, &line, line.cast0 + 10, 1000), 2000);
    for (uint32_t i = 0; i < 2000; i++) {
        long double d[3];
        direction(o.rig, &line, 10 + i / 2, d);
        double pane = 0.05 + 0.05 * 0.81, y = i % 2 ? 5.0 : 2.0 + 0.004 * 0.05 * 0.81 / pane;
        near_range(o.rig, i, ((long double)y - (long double)STATION[1]) / d[1]);
        assert_int_equal(o.rig->block.label[i], i % 2);
        double cdb = 1000.0 * log10((i % 2 ? 0.6 * 0.6561 : pane) * (double)d[1]);
        assert_true(fabs(o.rig->block.refl_cdb[i] - cdb) < 0.51);
    }
    close_optics(&o);
}

/* The same pulses return the same light, however a line is cut, with all noise on, in both layouts. */
static void cuts_leave_no_trace(void **state)
{
    (void)state;
    struct optics o;
    struct schedule_line line;
    struct detect_signal signal;
    struct sh_err err;
    struct detect_signal_spec spec = {.n_reaches = 1,
                                      .reach = {{0.9, 20.0}},
                                      .threshold_snr = 8.0,
                                      .sigma_m = 0.003,
                                      .sigma_at_m = 10.0,
                                      .sigma_reflectance = 0.9,
                                      .sigma_floor_m = 0.001,
                                      .seed = 4};
    assert_int_equal(detect_signal_set_up(&spec, &signal, &err), SH_OK);
    open_optics(&o, window());
    o.table.surface[0] = (struct surface){.reflectance = 0.03, .glass = 0.9};
    o.table.surface[1] = (struct surface){.reflectance = 0.06};
    o.table.has_optics = 1;
    const struct instrument k = {.mirror_sigma_rad = 1e-4, .mirror_key = 5, .transit_offset_m = 0.01};
    struct detect_ball ball = {.radius_m = 0.01, .factor = {1, 1, 1}};
    detect_ball_keys(&ball, 3);
    o.detect.signal = &signal;
    o.detect.noise_by_signal = 1;
    o.detect.instrument = &k;
    o.detect.ball = &ball;
    static uint32_t whole[4][3 * RIG_LINE];
    uint64_t seed = 9;
    for (int geo = 0; geo < 2; geo++) {
        o.rig->setup.layout = geo ? LINE_GEO : LINE_POLAR;
        uint32_t n = shoot_line(&o, 40, &line), points = o.rig->block.n_points, at = 0, none = 0, several = 0;
        for (uint32_t i = 0; i < points; i++) {
            whole[0][i] = o.rig->block.a[i];
            whole[1][i] = o.rig->block.b[i];
            whole[2][i] = o.rig->block.c[i];
            whole[3][i] = (uint16_t)o.rig->block.refl_cdb[i] | (uint32_t)o.rig->block.echo[i] << 16;
            none += o.rig->block.echo[i] == 0;
            several += o.rig->block.echo[i] > 0x20;
        }
        assert_true(none > 100 && several > 100);
        for (uint32_t done = 0; done < n;) {
            uint32_t piece = (uint32_t)case_between(&seed, 1, 90) * SCHEDULE_PACKET;
            if (piece > n - done) piece = n - done;
            cast_some(o.rig, &line, line.cast0 + done, piece);
            for (uint32_t i = 0; i < o.rig->block.n_points; i++, at++)
                assert_true(o.rig->block.a[i] == whole[0][at] && o.rig->block.b[i] == whole[1][at] &&
                            o.rig->block.c[i] == whole[2][at] &&
                            ((uint16_t)o.rig->block.refl_cdb[i] | (uint32_t)o.rig->block.echo[i] << 16) ==
                                whole[3][at]);
            done += piece;
        }
        assert_int_equal(at, points);
    }
    close_optics(&o);
}

/* If nothing is asked for, or none of it is met, the bytes are those of the plain caster. */
static void nothing_asked_for_changes_nothing(void **state)
{
    (void)state;
    static uint32_t plain[3][RIG_LINE];
    struct optics o;
    struct schedule_line line;
    open_optics(&o, box_scene(LO, HI));
    o.rig->setup.noise_on = 1;
    o.rig->setup.range_sigma_m = 0.003;
    o.rig->setup.noise_key = rng_key(1, RNG_RANGE);
    o.rig->setup.range_max_m = 5.5;
    for (int geo = 0; geo < 2; geo++) {
        o.rig->setup.layout = geo ? LINE_GEO : LINE_POLAR;
        o.rig->setup.detect = NULL;
        uint32_t n = shoot_line(&o, 40, &line);
        memcpy(plain[0], o.rig->block.a, n * sizeof(uint32_t));
        memcpy(plain[1], o.rig->block.b, n * sizeof(uint32_t));
        memcpy(plain[2], o.rig->block.c, n * sizeof(uint32_t));
        o.rig->setup.detect = &o.detect;
        assert_int_equal(shoot_line(&o, 40, &line), o.rig->block.n_points);
        assert_memory_equal(plain[0], o.rig->block.a, n * sizeof(uint32_t));
        assert_memory_equal(plain[1], o.rig->block.b, n * sizeof(uint32_t));
        assert_memory_equal(plain[2], o.rig->block.c, n * sizeof(uint32_t));
    }
    close_optics(&o);
}

/* A room whose ceiling and more is out of range. Shots without echo keep their scheduled angles and a range of 0 to the
 * bit, with any noise; the others don't. */
static void noise_never_touches_empty_shots(void **state)
{
    (void)state;
    static uint32_t plain[3][RIG_LINE];
    struct optics o;
    struct schedule_line line;
    open_optics(&o, box_scene(LO, HI));
    const struct instrument k = {.mirror_sigma_rad = 1e-3, .pan_sigma_rad = 1e-3, .mirror_key = 5, .pan_key = 6};
    struct detect_ball ball = {.radius_m = 0.05, .factor = {1, 1, 1}};
    detect_ball_keys(&ball, 3);
    o.rig->setup.range_max_m = 4.0;
    o.rig->setup.noise_on = 1;
    o.rig->setup.range_sigma_m = 0.01;
    o.rig->setup.noise_key = rng_key(1, RNG_RANGE);
    o.rig->setup.detect = NULL;
    uint32_t n = shoot_line(&o, 40, &line), empty = 0, moved = 0;
    memcpy(plain[0], o.rig->block.a, n * sizeof(uint32_t));
    memcpy(plain[1], o.rig->block.b, n * sizeof(uint32_t));
    memcpy(plain[2], o.rig->block.c, n * sizeof(uint32_t));
    o.rig->setup.detect = &o.detect;
    o.detect.instrument = &k;
    o.detect.ball = &ball;
    shoot_line(&o, 40, &line);
    for (uint32_t i = 0; i < n; i++) {
        int same =
            o.rig->block.a[i] == plain[0][i] && o.rig->block.b[i] == plain[1][i] && o.rig->block.c[i] == plain[2][i];
        if (o.rig->block.echo[i] == 0) /* the beam may stray to where there is nothing: the angles are the schedule's */
            assert_true(o.rig->block.a[i] == 0 && o.rig->block.b[i] == plain[1][i] && o.rig->block.c[i] == plain[2][i]);
        empty += o.rig->block.echo[i] == 0;
        moved += o.rig->block.echo[i] != 0 && !same;
    }
    assert_true(empty > 500 && moved > 500 && empty + moved == n);
    close_optics(&o);
}

/* Points move by up to half a metre, 50 steps of the colours. A colour is that of the range that is sent, to one step:
 * rounding to counts may move the range by so much. */
static void colours_show_the_ranges_that_are_sent(void **state)
{
    (void)state;
    const struct cast_colour colour = {.scale = {.mode = COLOUR_RANGE, .low = 0.0, .high = 7.65}};
    struct optics o;
    struct schedule_line line;
    struct sh_err err;
    open_optics(&o, box_scene(LO, HI));
    struct detect_ball ball = {.radius_m = 0.5, .factor = {1, 1, 1}};
    detect_ball_keys(&ball, 3);
    o.detect.ball = &ball;
    o.rig->setup.colour = &colour;
    assert_int_equal(line_block_alloc_colours(&o.rig->block, &err), SH_OK);
    const uint32_t n = shoot_line(&o, 40, &line);
    for (uint32_t i = 0; i < n; i++) {
        uint8_t rgb[3];
        assert_int_equal(o.rig->block.echo[i], 0x11);
        colour_between(0.0, 7.65, o.rig->block.a[i] * o.rig->setup.range_scale_m, rgb);
        for (int k = 0; k < 3; k++)
            assert_in_range(o.rig->block.rgb[i][k] + 1 - rgb[k], 0, 2);
    }
    close_optics(&o);
}

/* Each echo of a pulse has the colour of its own range: those of the pane, and that of the wall behind it. */
static void colours_of_all_echoes(void **state)
{
    (void)state;
    const struct cast_colour colour = {.scale = {.mode = COLOUR_RANGE, .low = 0.0, .high = 7.65}};
    struct optics o;
    struct schedule_line line;
    struct detect_signal signal;
    struct sh_err err;
    open_window(&o, &signal);
    o.detect.max_echoes = 3;
    o.rig->setup.colour = &colour;
    assert_int_equal(line_block_alloc_colours(&o.rig->block, &err), SH_OK);
    schedule_get_line(&o.rig->segment, 0, &line);
    assert_int_equal(cast_some(o.rig, &line, line.cast0 + 10, 100), 300);
    for (uint32_t i = 0; i < 300; i++) {
        uint8_t rgb[3];
        assert_int_equal(o.rig->block.echo[i], (i % 3 + 1) | 0x30);
        colour_between(0.0, 7.65, o.rig->block.a[i] * o.rig->setup.range_scale_m, rgb);
        for (int k = 0; k < 3; k++)
            assert_in_range(o.rig->block.rgb[i][k] + 1 - rgb[k], 0, 2);
    }
    close_optics(&o);
}

/* A mirror is on a body that moves: it is turned by 45 degrees about z through (0, 2, 0), then 1 m ahead. Beams that
 * meet it go on to the wall at x = -4: the way there plus the rest, at right angles. */
static void a_mirror_that_moves(void **state)
{
    (void)state;
    static const double vertex[4][3] = {{-1, 2, -1}, {1, 2, -1}, {1, 2, 1}, {-1, 2, 1}};
    static const uint32_t triangle[2][3] = {{0, 1, 2}, {0, 2, 3}};
    static const uint16_t label[2] = {6, 6};
    struct optics o;
    struct sh_err err;
    struct schedule_line line;
    struct scene_surface named[7] = {{.object = ""}};
    const double centre[3] = {0, 2, 0};
    open_optics(&o, box_scene(LO, HI));
    surface_table_free(&o.table);
    assert_int_equal(surface_table_alloc(7, &o.table, &err), 0);
    for (int i = 0; i < 6; i++)
        o.table.surface[i].reflectance = 0.5;
    o.table.surface[6].mirror = 1.0;
    o.detect.ghost_label = 7;
    struct scene *body = made_scene(&(struct scene_arrays){vertex, 4, triangle, 2, label, named, 7});
    struct bvh *bvh = made_bvh(body);
    struct cast_mover *m = &o.rig->setup.mover[0];
    *m = (struct cast_mover){.bvh = bvh, .centre_m = {0, 2, 0}, .radius_m = 1.5};
    pose_heading(atan(1.0), m->rotation); /* clockwise: the mirror's plane is then y - 3 = -x */
    for (int i = 0; i < 3; i++)
        m->shift_m[i] = centre[i] - m->rotation[3 * i + 1] * 2.0 + (i == 1);
    o.rig->setup.n_movers = 1;
    o.rig->spec.pan_udeg_s = 0;
    o.rig->spec.pan_stop_udeg = 0;
    schedule_start(&o.rig->segment, &o.rig->spec);
    schedule_get_line(&o.rig->segment, 0, &line);
    cast_some(o.rig, &line, 500, 1); /* straight ahead */
    /* The beam goes from (0.5, 0.25) along y to y = 2.5 on the plane; dir (0, 1, 0) becomes (-1, 0, 0): to the wall at
     * x = -4. */
    assert_int_equal(o.rig->block.label[0], 7 + 0);
    near_range(o.rig, 0, 2.25L + 4.5L);
    close_optics(&o);
    bvh_free(bvh);
    scene_free(body);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_mirror_shows_the_room_behind_it),
        cmocka_unit_test(facing_mirrors_end_at_the_depth),
        cmocka_unit_test(a_pane_and_what_is_behind_it),
        cmocka_unit_test(what_is_too_near_is_one_echo),
        cmocka_unit_test(cuts_leave_no_trace),
        cmocka_unit_test(nothing_asked_for_changes_nothing),
        cmocka_unit_test(noise_never_touches_empty_shots),
        cmocka_unit_test(colours_show_the_ranges_that_are_sent),
        cmocka_unit_test(colours_of_all_echoes),
        cmocka_unit_test(a_mirror_that_moves),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
