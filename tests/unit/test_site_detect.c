/* SPDX-License-Identifier: MIT */
/* A site follows a configuration's air and encoders, and mirrors are limited in scenes of many surfaces. */
#include "tests/unit/site_rig.h"

#include <math.h>

#include "core/instrument.h"
#include "firmware_sim/config/load.h"

static const char FLOOR[] = "o floor\nv -9 -9 0\nv 9 -9 0\nv 9 9 0\nf 1 2 3\n";

static int load(const char *more, struct site **site)
{
    char text[1024];
    *site = NULL;
    clear_warned();
    snprintf(text, sizeof text,
             "head: {profile: riegl-vz400i}\nscene: {meshes: [{file: room.obj, up: z, scale: 1}]}\n"
             "stations: [{position_m: [0, 0, 1.7]}]\nbeam: {mode: single}\n%s",
             more);
    write_in("test.yaml", text);
    int rc = config_load(config_path, NULL, 0, cfg, &err);
    return rc == SH_OK ? site_load(cfg, &report, site, &err) : rc;
}

/* Returns the amplitude of a white target at 400 m. */
static double amplitude(const char *signal)
{
    char text[128];
    struct site *site;
    snprintf(text, sizeof text, "signal: {model: on%s}\n", signal);
    write_in("room.obj", FLOOR);
    if (load(text, &site) != SH_OK) fail_msg("%s", err.text);
    const double a = detect_amplitude(site->detect.cast.signal, 400.0, 1.0);
    site_free(site);
    return a;
}

/* An extinction replaces that of the air. The data sheet's reaches hold for air with a visibility of 23 km. Such air's
 * extinction at 1550 nm is, by Kruse, 3.912 / 23 km (550 / 1550)^1.3. The signal changes by the difference of the
 * two extinctions, on the way there and back. The exponentials are rounded to some 1e-16 each. */
static void extinction_replaces_that_of_the_days_air(void **state)
{
    (void)state;
    char text[64];
    const double day_1_km = 3.912 / 23.0 * pow(550.0 / 1550.0, 1.3), as_quoted = amplitude("");
    snprintf(text, sizeof text, ", extinction_1_km: %.17g", day_1_km);
    assert_true(fabs(amplitude(text) / as_quoted - 1.0) < 1e-13);
    assert_true(fabs(amplitude(", visibility_m: 23000") / as_quoted - 1.0) < 1e-13);
    assert_true(amplitude(", visibility_m: 0.5") < 1e-100 * as_quoted); /* exp(-6259), as near 0 as floats go */
    const double ratio = exp(-2.0 * 0.4 * (0.5 - day_1_km));
    assert_true(fabs(amplitude(", extinction_1_km: 0.5") / as_quoted / ratio - 1.0) < 1e-13);
}

/* An encoder's error is eccentricity sin(angle - phase): zero at its own phase, and all of it a quarter of a turn on. A
 * rounding of a turn is 1e-16. */
static void each_encoder_has_a_phase_of_its_own(void **state)
{
    (void)state;
    struct site *site;
    double mirror_turn[2] = {10.0 / 360, 100.0 / 360}, pan_turn[2] = {70.0 / 360, 160.0 / 360};
    write_in("room.obj", FLOOR);
    if (load("instrument: {mirror_eccentricity_deg: 0.36, mirror_phase_deg: 10,\n"
             "             pan_eccentricity_deg: 0.72, pan_phase_deg: 70}\n",
             &site) != SH_OK)
        fail_msg("%s", err.text);
    instrument_read(&site->detect.instrument, 2, mirror_turn, pan_turn);
    assert_true(fabs(mirror_turn[0] - 10.0 / 360) < 1e-15 && fabs(mirror_turn[1] - 100.0 / 360 - 0.001) < 1e-15);
    assert_true(fabs(pan_turn[0] - 70.0 / 360) < 1e-15 && fabs(pan_turn[1] - 160.0 / 360 - 0.002) < 1e-15);
    site_free(site);
}

/* Writes n surfaces, the first of which is a mirror. */
static void write_surfaces(uint32_t n)
{
    char *text = malloc(100 * (size_t)n + 100), *p = text;
    assert_non_null(text);
    for (uint32_t i = 0; i < n; i++)
        p += sprintf(p, "o %u\nusemtl %s\nv %u 0 0\nv %u 1 0\nv %u 0 1\nf -3 -2 -1\n", i, i == 0 ? "silver" : "plaster",
                     i, i, i);
    write_in("room.obj", text);
    free(text);
}

/* Labels are 16 bits, and 65535 means none. A scene has up to 65534, and half of them are for ghosts. */
static void ghosts_need_labels(void **state)
{
    (void)state;
    static const char mirror[] = "surfaces: [{material: silver, mirror: 0.9}]\noptics: {depth: 1}\n";
    struct site *site;
    write_surfaces(32767);
    if (load(mirror, &site) != SH_OK) fail_msg("%s", err.text);
    assert_int_equal(site->n_surfaces, 65534);
    assert_string_equal(site_surface(site, 65533)->object, "ghost of 32766");
    site_free(site);
    write_surfaces(32768);
    assert_int_equal(load(mirror, &site), SH_EINPUT);
    assert_non_null(
        strstr(err.text,
               "32768 surfaces and a mirror: each needs a second label for its ghost points; allowed are up to 32767"));
    assert_int_equal(load("", &site), SH_OK); /* without a mirror they are allowed */
    site_free(site);
}

/* A single ray without glass has one return, but any number of echoes may be found in its samples. */
static void found_echoes_have_room(void **state)
{
    (void)state;
    static const char *const finds[] = {"model", "threshold", "fraction", "gaussians"};
    write_in("room.obj", FLOOR);
    for (int i = 0; i < 4; i++) {
        char text[128];
        struct site *site;
        snprintf(text, sizeof text, "signal: {model: on}\nwaveform: {send: on, echoes: %s}\n", finds[i]);
        if (load(text, &site) != SH_OK) fail_msg("%s", err.text);
        const uint32_t most = i == 0 ? 1 : site_profile(site)->max_echoes;
        assert_true(site_profile(site)->max_echoes > 1);
        assert_int_equal(site_points_per_pulse(site), most);
        assert_int_equal(site_most_points_per_pulse(site), most);
        site_free(site);
    }
}

/* A receiver of 10 MHz has an answer 31 ns long (0.312 / B), so it lowers the peak of the pulse of 3 ns to a tenth. The
 * level is then 0.8 times the noise of 1/8. The bandwidth that the warning names is enough. */
static void a_level_within_noise_is_said(void **state)
{
    (void)state;
    static const char *const finds[] = {"model", "gaussians"};
    struct site *site;
    char text[160];
    write_in("room.obj", FLOOR);
    for (int i = 0; i < 2; i++) {
        snprintf(text, sizeof text, "signal: {model: on}\nwaveform: {send: on, echoes: %s, bandwidth_mhz: 10}\n",
                 finds[i]);
        if (load(text, &site) != SH_OK) fail_msg("%s", err.text);
        site_free(site);
        assert_int_equal(strstr(warned, "of noise alone") != NULL, i);
    }
    const char *enough = strstr(warned, "waveform.bandwidth_mhz=");
    assert_non_null(enough);
    const double mhz = atof(strchr(enough, '=') + 1);
    for (int less = 0; less < 2; less++) { /* the warning names it to 10 % and 1 MHz */
        snprintf(text, sizeof text, "signal: {model: on}\nwaveform: {echoes: gaussians, bandwidth_mhz: %.0f}\n",
                 less ? 0.9 * mhz - 1.0 : mhz);
        if (load(text, &site) != SH_OK) fail_msg("%s", err.text);
        site_free(site);
        assert_int_equal(strstr(warned, "of noise alone") != NULL, less);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(extinction_replaces_that_of_the_days_air),
        cmocka_unit_test(each_encoder_has_a_phase_of_its_own),
        cmocka_unit_test(ghosts_need_labels),
        cmocka_unit_test(found_echoes_have_room),
        cmocka_unit_test(a_level_within_noise_is_said),
    };
    return cmocka_run_group_tests(tests, site_rig_setup, site_rig_teardown);
}
