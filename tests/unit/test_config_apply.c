/* SPDX-License-Identifier: MIT */
/* Settings that a client has changed become the configuration's: ranges of all programs, noise, steps. A schedule takes
 * the settings of its head. */
#include "tests/unit/config_rig.h"

#include <math.h>

static void settings_are_applied_whole(void **state)
{
    (void)state;
    assert_loads(load_with_head("riegl-vz400i", "", ""));
    struct head_settings s = cfg->head.settings;
    const double own_m = cfg->head.range_max_m, ball_m = cfg->noise.ball.radius_m;
    s.range_min_nm = 2500000000;
    s.noise = RANGE_NOISE_ON;
    s.angle_noise = 1;
    s.sigma_nm = 4000000;
    s.prr_uhz = 300000 * INT64_C(1000000);
    assert_int_equal(config_apply_settings(cfg, &s, &err), SH_OK);
    assert_memory_equal(&cfg->head.settings, &s, sizeof s);
    assert_true(cfg->head.range_min_m == 2.5 && cfg->head.range_max_m == own_m);
    assert_true(cfg->profile.range_min_m == 2.5 && cfg->profile.range_max_m == own_m);
    assert_true(cfg->noise.range == RANGE_NOISE_ON && cfg->noise.angle == 1 && cfg->noise.sigma_m == 0.004);
    assert_true(cfg->profile.range_sigma_m == 0.004 && cfg->noise.ball.radius_m == ball_m);
    assert_int_equal(cfg->profile.n_programs, 4);
    for (uint32_t i = 0; i < 4; i++) {
        const struct config_program *program = &cfg->profile.program[i];
        assert_true(program->range_min_m == 2.5 && program->range_max_m == program->own_max_m);
    }
    s.range_min_nm = 500000000; /* each program has its own again */
    s.range_max_nm = 300 * INT64_C(1000000000);
    assert_int_equal(config_apply_settings(cfg, &s, &err), SH_OK);
    assert_true(cfg->profile.range_max_m == 300.0 && cfg->profile.range_min_m == 0.5);
    for (uint32_t i = 0; i < 4; i++) {
        const struct config_program *program = &cfg->profile.program[i];
        assert_true(program->range_min_m == program->own_min_m && program->own_min_m >= 0.5);
        assert_true(program->range_max_m == fmin(program->own_max_m, 300.0));
    }
    /* a head without programs has the range of all rates */
    assert_loads(load_text(base));
    s = cfg->head.settings;
    s.range_max_nm = 20 * INT64_C(1000000000);
    assert_int_equal(config_apply_settings(cfg, &s, &err), SH_OK);
    assert_true(cfg->profile.n_programs == 0 && cfg->profile.program[0].range_max_m == 20.0);
}

static void a_step_is_applied_to_planes_and_spheres(void **state)
{
    (void)state;
    assert_loads(load_with_head("sick-lms111", "", ""));
    struct head_settings s = cfg->head.settings;
    assert_int_equal(cfg->profile.emitter.steps, 720);
    s.step_udeg = 250000;
    assert_int_equal(config_apply_settings(cfg, &s, &err), SH_OK);
    assert_int_equal(cfg->profile.emitter.steps, 1440);
    assert_loads(load_with_head("sphere", "  step_deg: 10\n  ring_start_deg: 9\n  ring_stop_deg: 11\n", ""));
    s = cfg->head.settings;
    assert_true(cfg->profile.emitter.steps == 36 && cfg->profile.emitter.rings == 1);
    s.step_udeg = 2000000; /* rings at -90, -88, ..: one at 10 */
    assert_int_equal(config_apply_settings(cfg, &s, &err), SH_OK);
    assert_true(cfg->profile.emitter.steps == 180 && cfg->profile.emitter.rings == 1);
    s.step_udeg = 1000000;
    assert_int_equal(config_apply_settings(cfg, &s, &err), SH_OK);
    assert_true(cfg->profile.emitter.steps == 360 && cfg->profile.emitter.rings == 3);
    s.step_udeg = 60000000; /* rings at -90, -30, 30, 90 */
    assert_int_equal(config_apply_settings(cfg, &s, &err), SH_EINPUT);
}

static void a_schedule_has_the_settings(void **state)
{
    (void)state;
    const struct head_settings s = {.prr_uhz = 1,
                                    .lines_uhz = 2,
                                    .pan_udeg_s = 3,
                                    .line_start_udeg = 4,
                                    .line_stop_udeg = 5,
                                    .pan_start_udeg = 6,
                                    .pan_stop_udeg = 7,
                                    .frames = 8};
    struct schedule_spec spec;
    assert_loads(load_with_head("riegl-vz400i", "", ""));
    config_fill_spec(&cfg->profile, &s, &spec);
    assert_true(spec.prr_uhz == 1 && spec.lines_uhz == 2 && spec.pan_udeg_s == 3 && spec.frames == 8);
    assert_true(spec.line_start_udeg == 4 && spec.line_stop_udeg == 5);
    assert_true(spec.pan_start_udeg == 6 && spec.pan_stop_udeg == 7);
    /* facets 3, gain 2: 240 deg of a sweep, which begins with the field of view */
    assert_true(spec.fov_min_udeg == -40000000 && spec.sweep_udeg == 240000000 && spec.emitter == NULL);
    assert_loads(load_with_head("velodyne-vlp16", "", ""));
    config_fill_spec(&cfg->profile, &s, &spec);
    assert_true(spec.fov_min_udeg == 0 && spec.sweep_udeg == 360000000 && spec.emitter == &cfg->profile.emitter);
    /* 1024 steps, the 384th of which is ahead: the first one is at -135 deg */
    assert_loads(load_with_head("hokuyo-urg-04lx", "", ""));
    config_fill_spec(&cfg->profile, &s, &spec);
    assert_true(spec.fov_min_udeg == -135000000 && spec.sweep_udeg == 360000000);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(settings_are_applied_whole),
        cmocka_unit_test(a_step_is_applied_to_planes_and_spheres),
        cmocka_unit_test(a_schedule_has_the_settings),
    };
    return cmocka_run_group_tests_name("settings applied", tests, set_up, tear_down);
}
