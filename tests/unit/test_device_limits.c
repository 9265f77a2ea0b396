/* SPDX-License-Identifier: MIT */
/* The limits that a head has for its clients, from its profile and configuration. The expected numbers were typed from
 * the profiles in config/heads. */
#include "firmware_sim/command/head.h"
#include "firmware_sim/config/load.h"
#include "firmware_sim/device/limits.h"
#include "firmware_sim/site/site.h"
#include "tests/unit/config_rig.h"

static const int64_t MICRO = 1000000, MM_NM = 1000000, M_NM = 1000000000;

/* Limits need a site's stations and whether its surfaces have optics, and no scene. */
static struct head_limits limits_of(int has_optics)
{
    struct head_limits l;
    struct site *site = calloc(1, sizeof *site);
    assert_non_null(site);
    site->cfg = cfg;
    site->n_stations = cfg->n_stations;
    site->detect.surfaces.has_optics = has_optics;
    memset(&l, 0xee, sizeof l);
    device_set_limits(site, &l);
    free(site);
    return l;
}

static struct head_limits limits_with(const char *const *sets, int n)
{
    assert_loads(load_sets(sets, n));
    return limits_of(0);
}

/* The slowest program keeps 2 m free of echoes, so range_max_m is above 2 m at all rates. The fastest reaches 250 m. */
static void a_line_head_has_those_of_its_programs(void **state)
{
    (void)state;
    static const int64_t rate_hz[] = {140000, 600000, 1200000, 2200000};
    assert_loads(load_changed("riegl-vz600i", "reach_90_m: { value: 1000, from: assumed }",
                              "reach_90_m: { value: 1000, from: assumed }\n    "
                              "range_min_m: { value: 2, from: assumed }"));
    const char *const sets[] = {"beam.mode=single"};
    const struct head_limits l = limits_with(sets, 1);
    assert_int_equal(l.n_rates, 4);
    for (int i = 0; i < 4; i++)
        assert_int_equal(l.rate_uhz[i], rate_hz[i] * MICRO);
    assert_true(l.prr_min_uhz == 140000 * MICRO && l.prr_max_uhz == 2200000 * MICRO);
    assert_true(l.lines_min_uhz == 4 * MICRO && l.lines_max_uhz == 420 * MICRO);
    assert_true(l.pan_max_udeg_s == 360 * MICRO && l.pan_min_udeg == 0 && l.pan_max_udeg == 360 * MICRO);
    assert_true(l.fov_min_udeg == -40 * MICRO && l.fov_max_udeg == 65 * MICRO);
    assert_true(l.range_min_nm == 500 * MM_NM && l.range_max_nm == 1000 * M_NM);
    assert_true(l.near_most_nm == 250 * M_NM - 1 && l.far_least_nm == 2 * M_NM + 1);
    assert_int_equal(l.emitter, EMITTER_LINE);
    assert_true(l.sweep_udeg == 240 * MICRO); /* 3 facets, and twice the mirror's angle */
    assert_true(l.line_pulses == 0 && !l.round && l.n_geometries == 0 && l.sequence_ps == 0 && !l.step_fixed);
    assert_true(l.phase_lock_most == 0 && l.waves_most == 0 && l.angle_most == 1);
    assert_true(l.n_stations == 1 && l.elsewhere == 0);
}

static void a_planar_head_has_its_geometries(void **state)
{
    (void)state;
    assert_loads(load_with_head("sick-lms111", "", "beam: {mode: single}\n"));
    struct head_limits l = limits_of(0);
    assert_int_equal(l.emitter, EMITTER_PLANAR);
    assert_int_equal(l.n_geometries, 3);
    assert_true(l.geometry[0].lines_uhz == 50 * MICRO && l.geometry[0].steps == 720);
    assert_true(l.geometry[1].lines_uhz == 25 * MICRO && l.geometry[1].steps == 1440);
    assert_true(l.geometry[2].lines_uhz == 25 * MICRO && l.geometry[2].steps == 720);
    assert_int_equal(l.line_pulses, 720);
    assert_true(l.prr_min_uhz == 18000 * MICRO && l.prr_max_uhz == 36000 * MICRO && l.n_rates == 0);
    assert_true(l.sweep_udeg == 0 && l.sequence_ps == 0 && l.phase_lock_most == 0 && !l.round && !l.step_fixed);
    assert_true(l.angle_most == 0); /* the profile gives no angle noise */
    assert_true(l.near_most_nm == 20 * M_NM - 1 && l.far_least_nm == 500 * MM_NM + 1);
    /* On a platform that moves it keeps its step, so only geometries of that step are left. */
    const char *const moves[] = {"platform.kind=live", "head.lines_hz=25", "head.step_deg=0.5"};
    l = limits_with(moves, 3);
    assert_true(l.step_fixed && l.n_geometries == 2);
    assert_true(l.geometry[0].lines_uhz == 50 * MICRO && l.geometry[1].lines_uhz == 25 * MICRO);
    assert_true(l.geometry[0].steps == 720 && l.geometry[1].steps == 720);
}

static void other_heads_have_what_they_can(void **state)
{
    (void)state;
    assert_loads(load_with_head("velodyne-vlp16", "", ""));
    struct head_limits l = limits_of(0);
    assert_int_equal(l.emitter, EMITTER_BEAMS);
    assert_true(l.phase_lock_most == 1 && l.sequence_ps == 55296000 && l.sweep_udeg == 0 && !l.round);
    assert_loads(load_with_head("sphere", "", ""));
    l = limits_of(0);
    assert_int_equal(l.emitter, EMITTER_SPHERE);
    assert_true(l.round == 1 && l.line_pulses == 360 && l.phase_lock_most == 0 && l.angle_most == 1);
    /* Noise of either angle is enough. */
    for (int i = 0; i < 2; i++) {
        assert_loads(load_changed("sphere",
                                  i == 0 ? "mirror_sigma_deg: { value: 0.002," : "pan_sigma_deg: { value: 0.002,",
                                  i == 0 ? "mirror_sigma_deg: { value: 0," : "pan_sigma_deg: { value: 0,"));
        assert_int_equal(limits_of(0).angle_most, 1);
    }
}

/* A method that was tried on the scene holds only within the ranges of power-up. */
static void ranges_stay_where_methods_were_tried(void **state)
{
    (void)state;
    static const struct {
        const char *set;
        int has_optics, tried;
    } rows[] = {{"beam.mode=single", 0, 0},   {"beam.mode=rings", 0, 0}, {"beam.mode=auto", 0, 1},
                {"beam.mode=adaptive", 0, 1}, {"beam.mode=rings", 1, 1}, {"optics.depth=2", 1, 0}};
    write_file(config_path, base, strlen(base));
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        const char *const sets[] = {"beam.mode=rings", "head.range_min_m=3", "head.range_max_m=70", rows[i].set};
        assert_loads(load_sets(sets, 4));
        const struct head_limits l = limits_of(rows[i].has_optics);
        assert_int_equal(l.range_min_nm, rows[i].tried ? 3 * M_NM : 1500 * MM_NM);
        assert_int_equal(l.range_max_nm, rows[i].tried ? 70 * M_NM : 800 * M_NM);
    }
    /* A head of single rays has no footprint to try. */
    assert_loads(load_with_head("sphere", "  range_min_m: 3\n", "beam: {mode: auto}\n"));
    assert_true(limits_of(0).range_min_nm == 100 * MM_NM);
}

static void noise_is_what_the_configuration_can_make(void **state)
{
    (void)state;
    static const struct {
        const char *sets[3];
        int n;
        uint32_t noise, waves;
        int64_t sigma_min_nm, ball_max_nm;
    } rows[] = {{{"head.profile=riegl-vz600i"}, 1, RANGE_NOISE_ON, 0, 0, 100000000000},
                {{"head.profile=riegl-vz600i", "signal.model=on"}, 2, RANGE_NOISE_SIGNAL, 0, 2980000, 100000000000},
                {{"head.profile=riegl-vz600i", "signal.model=on", "waveform.echoes=fraction"},
                 3,
                 RANGE_NOISE_OFF,
                 0,
                 2980000,
                 100000000000},
                {{"head.profile=riegl-vz600i", "signal.model=on", "waveform.send=on"},
                 3,
                 RANGE_NOISE_SIGNAL,
                 1,
                 2980000,
                 100000000000},
                {{"head.profile=riegl-vz600i", "platform.kind=live"}, 2, RANGE_NOISE_ON, 0, 0, 0},
                {{"head.profile=riegl-vz600i", "platform.kind=live", "noise.ball.axes=beam"},
                 3,
                 RANGE_NOISE_ON,
                 0,
                 0,
                 100000000000}};
    char *text = edited(PRR LINES, "");
    write_file(config_path, text, strlen(text));
    free(text);
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        const struct head_limits l = limits_with(rows[i].sets, rows[i].n);
        assert_int_equal(l.noise_most, rows[i].noise);
        assert_int_equal(l.waves_most, rows[i].waves);
        assert_int_equal(l.sigma_min_nm, rows[i].sigma_min_nm);
        assert_int_equal(l.ball_max_nm, rows[i].ball_max_nm);
    }
}

/* Bits mark the stations whose scanner is not that of head.station. */
static void stations_of_other_scanners_are_elsewhere(void **state)
{
    (void)state;
    static const char *const sets[] = {"stations[1]={position_m: [0, 0, 0], scanner: {head: {prr_hz: 600000}}}",
                                       "stations[2]={position_m: [5, 0, 0]}", "head.station=1"};
    const char *const other[] = {sets[0], sets[1], "head.station=2"};
    write_file(config_path, base, strlen(base));
    struct head_limits l = limits_with(sets, 3);
    assert_true(l.n_stations == 3 && l.elsewhere == 2);
    l = limits_with(other, 3);
    assert_true(l.n_stations == 3 && l.elsewhere == 5);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_line_head_has_those_of_its_programs),
        cmocka_unit_test(a_planar_head_has_its_geometries),
        cmocka_unit_test(other_heads_have_what_they_can),
        cmocka_unit_test(ranges_stay_where_methods_were_tried),
        cmocka_unit_test(noise_is_what_the_configuration_can_make),
        cmocka_unit_test(stations_of_other_scanners_are_elsewhere),
    };
    return cmocka_run_group_tests_name("device limits", tests, set_up, tear_down);
}
