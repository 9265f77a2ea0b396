/* SPDX-License-Identifier: MIT */
/* A site that is planned for other settings leaves the one that it is made from as it is. */
#include "tests/unit/site_rig.h"

#include <math.h>

#include "firmware_sim/command/head.h"

static int is(double scale, double want)
{
    return fabs(scale / want - 1) < 1e-9; /* a power of ten, to a few roundings */
}

/* Coordinates up to 2500 m need counts of 10 um, those up to 1000 m only of 1 um (31 bits). Each station has a scale
 * for each leg of the path. */
static void the_legs_of_other_stations_keep_their_scale(void **state)
{
    (void)state;
    struct site *site, *near;
    write_in("room.obj", "v -50 -50 0\nv 50 -50 0\nv 50 50 0\nv -50 50 0\nf 1 2 3 4\n");
    write_in("path.csv", "t_s,x_m,y_m,z_m,heading_deg,pitch_deg,roll_deg\n0,0,0,2,0,0,0\n1,2,0,2,0,0,0\n");
    write_in("test.yaml", "head: {profile: riegl-vz2000i, prr_hz: 50000}\n"
                          "scene: {meshes: [{file: room.obj, up: z, scale: 1}]}\n"
                          "stations: [{position_m: [0, 0, 2]}, {position_m: [5, 0, 2]}]\n"
                          "platform: {kind: trajectory, file: path.csv}\nbeam: {mode: single}\n"
                          "output: {crs: local, layout: geo}\n");
    if (config_load(config_path, NULL, 0, cfg, &err) != SH_OK || site_load(cfg, &report, &site, &err) != SH_OK)
        fail_msg("%s", err.text);
    struct head_settings settings = cfg->head.settings;
    settings.range_max_nm = 1000000000000;
    for (uint32_t i = 0; i < 2; i++)
        assert_true(is(site->station[i].on_stretch[0].scale[0], 1e-5));
    if (site_vary(site, &settings, 0, &near, &err) != SH_OK) fail_msg("%s", err.text);
    assert_true(is(near->scale_m, 1e-6) && is(near->station[0].on_stretch[0].scale[0], 1e-6));
    for (uint32_t i = 0; i < 2; i++)
        assert_true(is(site->station[i].on_stretch[0].scale[0], 1e-5));
    site_vary_free(near);
    site_free(site);
}

/* Ranges and noise are those of the new settings. The other settings stay as at power-up: no plan depends on them. */
static void the_plan_has_the_new_settings(void **state)
{
    (void)state;
    struct site *site, *other;
    write_in("room.obj", "v -50 -50 0\nv 50 -50 0\nv 50 50 0\nv -50 50 0\nf 1 2 3 4\n");
    write_in("test.yaml", "head: {profile: riegl-vz400i, prr_hz: 300000}\n"
                          "scene: {meshes: [{file: room.obj, up: z, scale: 1}]}\n"
                          "stations: [{position_m: [0, 0, 2]}]\nbeam: {mode: single}\noutput: {crs: local}\n"
                          "noise: {range: off, angle: off}\n");
    if (config_load(config_path, NULL, 0, cfg, &err) != SH_OK || site_load(cfg, &report, &site, &err) != SH_OK)
        fail_msg("%s", err.text);
    const struct head_settings own = cfg->head.settings;
    struct head_settings new = own;
    new.range_min_nm = 2000000000;
    new.range_max_nm = 90000000000;
    new.noise = 1;
    new.angle_noise = 1;
    new.sigma_nm = 7000000;
    new.ball_nm = 3000000;
    new.prr_uhz = own.prr_uhz / 2;
    new.frames = own.frames + 3;
    if (site_vary(site, &new, 0, &other, &err) != SH_OK) fail_msg("%s", err.text);
    const struct config *c = other->cfg;
    assert_true(fabs(c->profile.range_min_m - 2.0) < 1e-12 && fabs(c->profile.range_max_m - 90.0) < 1e-12);
    assert_true(c->noise.range == RANGE_NOISE_ON && c->noise.angle == 1);
    assert_true(fabs(c->noise.sigma_m - 0.007) < 1e-12 && fabs(c->noise.ball.radius_m - 0.003) < 1e-12);
    assert_true(c->head.settings.prr_uhz == own.prr_uhz && c->head.settings.frames == own.frames);
    assert_false(site_varies(&new, &c->head.settings));
    assert_true(cfg->noise.angle == 0 && site->cfg == cfg);
    site_vary_free(other);
    site_free(site);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(the_legs_of_other_stations_keep_their_scale, site_rig_setup, site_rig_teardown),
        cmocka_unit_test_setup_teardown(the_plan_has_the_new_settings, site_rig_setup, site_rig_teardown),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
