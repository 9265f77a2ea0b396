/* SPDX-License-Identifier: MIT */
/* Echoes behind glass, in mirrors and on bodies: ghosts, sent echoes, and the hits among them. */
#include "tests/common/made.h"
#include "tests/unit/optics_rig.h"

/* A mirror is ahead, a pane behind the head, and a wall behind that. Pane and wall, seen in the mirror, are both
 * ghosts, and are no hits. Seen directly, pane and wall are no ghosts. The ranges of ghosts are those of the folded
 * way. */
static void glass_in_a_mirror(void **state)
{
    (void)state;
    static struct cast_hit hit[2 * (1 + CAST_MAX_DEPTH)];
    struct optics o;
    struct schedule_line line;
    struct schedule_run run;
    open_optics(&o, sheets((const double[]){3.0, -1.0, -2.0}, (const uint16_t[]){2, 0, 1}));
    o.table.surface[0] = (struct surface){.reflectance = 0.05, .glass = 0.9};
    o.table.surface[1] = (struct surface){.reflectance = 0.6};
    o.table.surface[2] = (struct surface){.mirror = 1.0};
    o.table.has_optics = 1;
    o.rig->spec.pan_udeg_s = 0;
    schedule_start(&o.rig->segment, &o.rig->spec);
    schedule_get_line(&o.rig->segment, 0, &line);
    for (uint32_t back = 0; back < 2; back++) { /* level, ahead; level, back */
        const uint64_t k = line.pulse0 + (line.pulse_end - line.pulse0) * (back ? 220 : 40) / 240;
        const double far[2] = {back ? 1.25 : 2.75 + 4.0, back ? 2.25 : 2.75 + 5.0};
        assert_int_equal(cast_some(o.rig, &line, k, 1), 2);
        for (uint32_t i = 0; i < 2; i++) {
            near_range(o.rig, i, (long double)far[i]);
            assert_int_equal(o.rig->block.echo[i], (i + 1) | 0x20);
            assert_int_equal(o.rig->block.label[i], i + (back ? 0 : 3));
        }
        schedule_get_run(&o.rig->segment, &line, k, 1, &run);
        assert_int_equal(caster_meet(o.rig->caster, &o.rig->setup, &run, hit), back ? 2 : 0);
    }
    close_optics(&o);
}

/* For a pane and a dark wall behind it a head sends the first, the last or the strongest. */
static void one_of_a_pulse_s_echoes(void **state)
{
    (void)state;
    static const enum beam_select select[] = {BEAM_FIRST, BEAM_LAST, BEAM_STRONGEST};
    static const double y[] = {2.0, 5.0, 2.004};
    struct optics o;
    struct schedule_line line;
    open_optics(&o, window());
    o.table.surface[0] = (struct surface){.reflectance = 0.05, .glass = 0.9, .specular = 0.0};
    o.table.surface[1] = (struct surface){.reflectance = 0.01};
    o.table.has_optics = 1;
    schedule_get_line(&o.rig->segment, 0, &line);
    for (int k = 0; k < 2; k++) { /* the strongest is the pane's near side, too */
        o.rig->setup.echoes = select[k];
        assert_int_equal(cast_some(o.rig, &line, line.cast0 + 10, 100), 100);
        for (uint32_t i = 0; i < 100; i++) {
            long double d[3];
            direction(o.rig, &line, 10 + i, d);
            near_range(o.rig, i, ((long double)y[k] - (long double)STATION[1]) / d[1]);
            assert_int_equal(o.rig->block.echo[i], 0x11);
        }
    }
    o.rig->setup.echoes = BEAM_STRONGEST;
    o.table.surface[1].reflectance = 0.6;
    cast_some(o.rig, &line, line.cast0 + 10, 100);
    for (uint32_t i = 0; i < 100; i++)
        assert_int_equal(o.rig->block.label[i], 1);
    close_optics(&o);
}

/* Each echo of a pulse has noise of its own, keyed by the pulse and the echo's number, whether near ones are merged or
 * not. */
static void echoes_have_their_own_noise(void **state)
{
    (void)state;
    static const double y[] = {2.0, 2.004, 5.0};
    struct optics o;
    struct schedule_line line;
    int swapped = 0;
    open_optics(&o, window());
    o.table.surface[0] = (struct surface){.reflectance = 0.05, .glass = 0.9};
    o.table.has_optics = 1;
    o.rig->setup.noise_on = 1;
    o.rig->setup.range_sigma_m = 0.01;
    o.rig->setup.range_sigma_ppm = 100.0;
    o.rig->setup.noise_key = rng_key(7, RNG_RANGE);
    o.rig->setup.scan_key = rng_scan(0, 3);
    for (int merges = 0; merges < 2; merges++) {
        o.detect.separation_m = merges ? 1e-6 : 0.0;
        schedule_get_line(&o.rig->segment, 0, &line);
        assert_int_equal(cast_some(o.rig, &line, line.cast0 + 10, 20), 60);
        for (uint32_t pulse = 0; pulse < 20; pulse++) {
            double range_m[3];
            for (uint32_t i = 0; i < 3; i++) {
                const uint64_t key = rng_echo(line.cast0 + 10 + pulse, i);
                long double d[3];
                direction(o.rig, &line, 10 + pulse, d);
                range_m[i] = (double)(((long double)y[i] - (long double)STATION[1]) / d[1]);
                detect_fixed_noise(0.01, 1e-4, o.rig->setup.noise_key ^ o.rig->setup.scan_key, 1, &key, &range_m[i]);
            }
            swapped += range_m[0] > range_m[1]; /* core/line.h: in order of the ranges that are sent */
            near_range(o.rig, 3 * pulse, (long double)fmin(range_m[0], range_m[1]));
            near_range(o.rig, 3 * pulse + 1, (long double)fmax(range_m[0], range_m[1]));
            near_range(o.rig, 3 * pulse + 2, (long double)range_m[2]);
        }
    }
    assert_in_range(swapped, 2, 38); /* of 40 */
    close_optics(&o);
}

/* With noise of 3 m some echoes of the pane and of the wall get ranges of 0 or less. These are lost, and each of them is
 * counted once. The others are sent. */
static void echoes_that_noise_moves_behind_the_head_are_lost(void **state)
{
    (void)state;
    enum { N = 100 };
    static const double y[] = {2.0, 2.004, 5.0};
    struct optics o;
    struct schedule_line line;
    struct cast_counters counters;
    uint32_t sent = 0, lost_later = 0;
    open_optics(&o, window());
    o.table.surface[0] = (struct surface){.reflectance = 0.05, .glass = 0.9};
    o.table.has_optics = 1;
    o.rig->setup.noise_on = 1;
    o.rig->setup.range_sigma_m = 3.0;
    o.rig->setup.noise_key = rng_key(7, RNG_RANGE);
    o.rig->setup.scan_key = rng_scan(0, 3);
    schedule_get_line(&o.rig->segment, 0, &line);
    for (uint32_t i = 0; i < 3 * N; i++) {
        const uint32_t pulse = 10 + i / 3;
        const uint64_t key = rng_echo(line.cast0 + pulse, i % 3);
        long double d[3];
        direction(o.rig, &line, pulse, d);
        double range_m = (double)(((long double)y[i % 3] - (long double)STATION[1]) / d[1]);
        detect_fixed_noise(3.0, 0.0, o.rig->setup.noise_key ^ o.rig->setup.scan_key, 1, &key, &range_m);
        sent += range_m > 0.5 * o.rig->setup.range_scale_m;
        lost_later += i % 3 > 0 && range_m < 0.0;
    }
    assert_in_range(lost_later, 10, 2 * N - 10);
    assert_int_equal(cast_some(o.rig, &line, line.cast0 + 10, N), sent);
    caster_get_counters(o.rig->caster, &counters);
    assert_int_equal(counters.faint, 3 * N - sent);
    close_optics(&o);
}

/* An echo that does not fit into 31 bits of counts is dropped and counted. In this test the wall does not fit, while
 * the pane's two sides do and are numbered as two. If no echo fits, one entry stays, without echo. */
static void echoes_that_do_not_fit(void **state)
{
    (void)state;
    static const double most_m[] = {4.0, 0.5};
    struct optics o;
    struct schedule_line line;
    struct cast_counters before, after;
    open_optics(&o, window());
    o.table.surface[0] = (struct surface){.reflectance = 0.05, .glass = 0.9};
    o.table.has_optics = 1;
    o.rig->setup.layout = LINE_GEO;
    schedule_get_line(&o.rig->segment, 0, &line);
    const uint64_t level = line.pulse0 + (line.pulse_end - line.pulse0) * 40 / 240;
    for (int k = 0; k < 2; k++) {
        const uint32_t fit = k == 0 ? 2 : 0, entries = k == 0 ? 2 : 1;
        for (int i = 0; i < 3; i++)
            o.rig->setup.xyz_scale[i] = most_m[k] / 2147483647.0;
        caster_get_counters(o.rig->caster, &before);
        assert_int_equal(cast_some(o.rig, &line, level, 100), 100 * fit);
        caster_get_counters(o.rig->caster, &after);
        assert_int_equal(after.unfit - before.unfit, 100 * (3 - fit));
        assert_int_equal(o.rig->block.n_points, 100 * entries);
        for (uint32_t i = 0; i < 100 * entries; i++) {
            assert_int_equal(o.rig->block.echo[i], fit == 0 ? 0 : (i % 2 + 1) | 0x20);
            assert_int_equal(o.rig->block.label[i], fit == 0 ? LINE_LABEL_NONE : 0);
        }
    }
    close_optics(&o);
}

/* The head moves along x. All three echoes of a pulse lie where its own beam has gone, on the planes and at its x. */
static void echoes_of_a_moving_head(void **state)
{
    (void)state;
    static const double y[] = {2.0, 2.004, 5.0};
    struct optics o;
    struct schedule_line line;
    const struct pose_knot knot[2] = {{.t_ns = 0, .pose = {.position_m = {0, 0, 0}, .quat = {1, 0, 0, 0}}},
                                      {.t_ns = 10000000, .pose = {.position_m = {20, 0.5, 0}, .quat = {1, 0, 0, 0}}}};
    open_optics(&o, window());
    o.table.surface[0] = (struct surface){.reflectance = 0.05, .glass = 0.9};
    o.table.has_optics = 1;
    o.rig->setup.layout = LINE_GEO;
    o.rig->setup.xyz_scale[0] = o.rig->setup.xyz_scale[1] = o.rig->setup.xyz_scale[2] = 1e-6;
    o.rig->setup.knot = knot;
    o.rig->setup.n_knots = 2;
    o.rig->spec.pan_udeg_s = 0;
    schedule_start(&o.rig->segment, &o.rig->spec);
    schedule_get_line(&o.rig->segment, 0, &line);
    const uint64_t level = line.pulse0 + (line.pulse_end - line.pulse0) * 40 / 240;
    assert_int_equal(cast_some(o.rig, &line, level, 500), 1500);
    for (uint32_t i = 0; i < 1500; i++) {
        const double x_m = 20.0 * (double)schedule_time_ns(&o.rig->segment, level + i / 3) / 1e7;
        /* The bound is half a count; places are from the station, as counts are. */
        assert_true(fabs((int32_t)o.rig->block.b[i] * 1e-6 - (y[i % 3] - STATION[1])) < 0.5e-6 + 1e-9);
        assert_true(fabs((int32_t)o.rig->block.a[i] * 1e-6 - (x_m - STATION[0])) < 0.5e-6 + 1e-9);
    }
    close_optics(&o);
}

/* A plate on a body is met from its front. With the body turned by 180 degrees in its place, it is met from its
 * back. */
static void which_side_of_a_body_is_met(void **state)
{
    (void)state;
    static const double vertex[4][3] = {{-1, 3, -1}, {1, 3, -1}, {1, 3, 1}, {-1, 3, 1}};
    static const uint32_t triangle[2][3] = {{0, 1, 2}, {0, 2, 3}};
    struct optics o;
    struct schedule_line line;
    struct schedule_run run;
    struct cast_hit hit[1 + CAST_MAX_DEPTH];
    open_optics(&o, box_scene(LO, HI));
    struct scene *body = made_scene(&(struct scene_arrays){vertex, 4, triangle, 2, NULL, NULL, 0});
    struct bvh *bvh = made_bvh(body);
    o.rig->spec.pan_udeg_s = 0;
    schedule_start(&o.rig->segment, &o.rig->spec);
    schedule_get_line(&o.rig->segment, 0, &line);
    schedule_get_run(&o.rig->segment, &line, 500, 1, &run); /* straight ahead */
    o.rig->setup.n_movers = 1;
    for (int turned = 0; turned < 2; turned++) {
        struct cast_mover *m = &o.rig->setup.mover[0];
        *m = (struct cast_mover){.bvh = bvh, .centre_m = {0, 3, 0}, .radius_m = 1.5};
        pose_heading(turned ? 4.0 * atan(1.0) : 0.0, m->rotation);
        m->shift_m[1] = turned ? 6.0 : 0.0;
        assert_int_equal(caster_meet(o.rig->caster, &o.rig->setup, &run, hit), 1);
        assert_int_equal(hit[0].body, 1);
        assert_int_equal(hit[0].front, !turned);
        assert_true(fabs(hit[0].range_m - 2.75) < 1e-9 && fabs(hit[0].cosine - 1.0) < 1e-9);
    }
    close_optics(&o);
    bvh_free(bvh);
    scene_free(body);
}

/* A surface below the threshold is no hit, just as it has no echo. The room's walls are seen up to 4 m. */
static void what_is_too_faint_is_not_met(void **state)
{
    (void)state;
    static struct cast_hit hit[RIG_LINE * (1 + CAST_MAX_DEPTH)];
    const struct detect_signal_spec spec = {.n_reaches = 1, .reach = {{0.5, 4.0}}, .threshold_snr = 8.0, .sharp = 1};
    struct detect_signal signal;
    struct optics o;
    struct schedule_line line;
    struct schedule_run run;
    struct sh_err err;
    uint32_t at = 0;
    assert_int_equal(detect_signal_set_up(&spec, &signal, &err), SH_OK);
    open_optics(&o, box_scene(LO, HI));
    o.detect.signal = &signal;
    const uint32_t n = shoot_line(&o, 40, &line);
    schedule_get_run(&o.rig->segment, &line, line.cast0, n, &run);
    const uint32_t met = caster_meet(o.rig->caster, &o.rig->setup, &run, hit);
    for (uint32_t i = 0; i < n; i++) {
        if (o.rig->block.echo[i] == 0) continue;
        assert_true(at < met && hit[at].pulse == i);
        at++;
    }
    assert_int_equal(at, met);
    assert_true(met > 500 && met < n - 500);
    close_optics(&o);
}

/* A pulse leaves each 10/3 us, so a zone is 1e-5 c / 6 long. The end of a long room lies in the second one. */
static void zones_follow_the_pulse_rate(void **state)
{
    (void)state;
    static const double far[3] = {6, 700, 3};
    const long double zone_m = 299792458.0L * 1e-5L / 6;
    struct optics o;
    struct schedule_line line;
    struct cast_counters before, after;
    open_optics(&o, box_scene(LO, far));
    o.rig->spec.pan_udeg_s = 0;
    schedule_start(&o.rig->segment, &o.rig->spec);
    schedule_get_line(&o.rig->segment, 0, &line);
    const uint64_t level = line.pulse0 + (line.pulse_end - line.pulse0) * 40 / 240;
    for (int zones = 0; zones <= 2; zones++) { /* 0: folded */
        o.detect.ambiguity = zones == 0 ? DETECT_FOLDED : DETECT_RESOLVED;
        o.detect.zones = (uint32_t)zones;
        caster_get_counters(o.rig->caster, &before);
        assert_int_equal(cast_some(o.rig, &line, level, 1), zones != 1);
        caster_get_counters(o.rig->caster, &after);
        assert_int_equal(after.faint - before.faint, zones == 1);
        if (zones != 1) near_range(o.rig, 0, 699.75L - (zones == 0 ? zone_m : 0));
    }
    close_optics(&o);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(glass_in_a_mirror),
        cmocka_unit_test(one_of_a_pulse_s_echoes),
        cmocka_unit_test(echoes_that_do_not_fit),
        cmocka_unit_test(echoes_of_a_moving_head),
        cmocka_unit_test(which_side_of_a_body_is_met),
        cmocka_unit_test(what_is_too_faint_is_not_met),
        cmocka_unit_test(echoes_have_their_own_noise),
        cmocka_unit_test(zones_follow_the_pulse_rate),
        cmocka_unit_test(echoes_that_noise_moves_behind_the_head_are_lost),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
