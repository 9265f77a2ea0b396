/* SPDX-License-Identifier: MIT */
/* Checks between keys are tried at exactly their bounds: what is at the bound loads, and what is just beyond it gives
 * one error of this key. The texts of these errors are in test_config_messages.c. */
#include "firmware_sim/config/load.h"
#include "tests/unit/config_rig.h"

struct bound {
    const char *head, *settings;
    const char *at, *beyond; /* "with %s" of the rig: sections before output */
    const char *key;
};

/* Expects of a load that it gave one error of the key, or none where there is no key. */
static void expect_key(int code, const char *what, const char *key)
{
    char place[96];
    if ((code == SH_OK) != (key == NULL)) fail_msg("%s: %s", what, key == NULL ? err.text : "taken");
    if (key == NULL) return;
    snprintf(place, sizeof place, ": %s: ", key);
    if (strstr(err.text, place) == NULL || diagnostics.n != 1) fail_msg("%s: %s", what, err.text);
}

static void check(const char *head, const char *settings, const char *with, const char *key)
{
    char what[512];
    snprintf(what, sizeof what, "%s%s", settings, with);
    expect_key(load_with_head(head, settings, with), what, key);
}

static void check_all(const struct bound *bounds, size_t n)
{
    for (size_t i = 0; i < n; i++) {
        check(bounds[i].head, bounds[i].settings, bounds[i].at, NULL);
        check(bounds[i].head, bounds[i].settings, bounds[i].beyond, bounds[i].key);
    }
}

/* The two columns are settings of the head, not sections. */
static void settings_of_the_head(void **state)
{
    (void)state;
    static const struct {
        const char *head, *at, *beyond, *key;
    } bounds[] = {
        {"any-rate", "  pan_start_deg: 90\n  pan_stop_deg: 90\n", "  pan_start_deg: 90\n  pan_stop_deg: 89.999999\n",
         "head.pan_stop_deg"},
        {"any-rate", "  pan_start_deg: 0\n  pan_stop_deg: 360\n", "  pan_stop_deg: 360.000001\n", "head.pan_stop_deg"},
        {"any-rate", "  line_start_deg: 5\n  line_stop_deg: 5.000001\n", "  line_start_deg: 5\n  line_stop_deg: 5\n",
         "head.line_stop_deg"},
        {"any-rate", "  line_start_deg: -40\n  line_stop_deg: 60\n", "  line_start_deg: -40.000001\n",
         "head.line_start_deg"},
        {"any-rate", "  prr_hz: 1200000\n  lines_hz: 240\n", "  lines_hz: 240.000001\n", "head.lines_hz"},
        {"any-rate", "  prr_hz: 100000\n  lines_hz: 3\n", "  lines_hz: 2.999999\n", "head.lines_hz"},
        {"any-rate", "  pan_deg_s: 150\n", "  pan_deg_s: 150.000001\n", "head.pan_deg_s"},
        {"any-rate", "  range_min_m: 1.5\n  range_max_m: 800\n", "  range_min_m: 1.499\n", "head.range_min_m"},
        {"any-rate", "  range_min_m: 799.999\n", "  range_min_m: 800\n", "head.range_min_m"},
        {"any-rate", "  range_min_m: 2\n  range_max_m: 2.001\n", "  range_min_m: 2\n  range_max_m: 2\n",
         "head.range_max_m"},
        /* the slowest rate sees from 1.5 m, the fastest to 250 m */
        {"riegl-vz400i", "  range_min_m: 249.999\n", "  range_min_m: 250\n", "head.range_min_m"},
        {"riegl-vz400i", "  range_max_m: 1.501\n", "  range_max_m: 1.5\n", "head.range_max_m"},
        {"sphere", "  line_start_deg: 90\n  line_stop_deg: 89\n", "  line_start_deg: 90\n  line_stop_deg: 90\n",
         "head.line_stop_deg"},
        {"sphere", "  ring_start_deg: 10\n  ring_stop_deg: 10\n", "  ring_start_deg: 10\n  ring_stop_deg: 9.999999\n",
         "head.ring_stop_deg"},
        {"sphere", "  ring_start_deg: 10\n", "  ring_start_deg: 90.000001\n", "head.ring_start_deg"},
        /* a pulse rate that follows from a wrong line rate is no second error */
        {"sphere", "  step_deg: 10\n  lines_hz: 1000\n", "  step_deg: 10\n  lines_hz: 1001\n", "head.lines_hz"},
        {"velodyne-vlp16", "  phase_lock: on\n  lines_hz: 9\n", "  phase_lock: on\n  lines_hz: 9.000001\n",
         "head.phase_lock"},
        {"hokuyo-urg-04lx", "  prr_hz: 10240\n", "  prr_hz: 10240.000001\n", "head.prr_hz"},
        {"riegl-vz400i", "  prr_hz: 300000\n", "  prr_hz: 300000.000001\n", "head.prr_hz"},
    };
    for (size_t i = 0; i < sizeof bounds / sizeof bounds[0]; i++) {
        check(bounds[i].head, bounds[i].at, "", NULL);
        check(bounds[i].head, bounds[i].beyond, "", bounds[i].key);
    }
}

#define ANY         "any-rate", ""
#define VZ          "riegl-vz400i", ""
#define ALL(bounds) check_all(bounds, sizeof bounds / sizeof bounds[0])

static void noise_signal_and_surfaces(void **state)
{
    (void)state;
    static const struct bound bounds[] = {
        /* range_sigma_floor_m of the profile is 0.00295 */
        {ANY, "noise: {sigma_m: 0.00295}\nsignal: {model: on}\n", "noise: {sigma_m: 0.002949}\nsignal: {model: on}\n",
         "noise.sigma_m"},
        {ANY, "noise: {sigma_m: 0}\n", "noise: {sigma_m: 0}\nsignal: {model: on}\n", "noise.sigma_m"},
        {ANY, "noise: {ball: {radius_m: 0}}\nplatform: {kind: live}\n",
         "noise: {ball: {radius_m: 1e-9}}\nplatform: {kind: live}\n", "noise.ball.radius_m"},
        {ANY, "noise: {ball: {radius_m: 1, axes: beam}}\nplatform: {kind: live}\n",
         "noise: {ball: {radius_m: 1, axes: scene}}\nplatform: {kind: live}\n", "noise.ball.axes"},
        {ANY, "noise: {ball: {radius_m: 1}}\n", "noise: {ball: {radius_m: 1}}\nplatform: {kind: live}\n",
         "noise.ball.radius_m"},
        {ANY, "surfaces: [{reflectance: 0.25, specular: 0.25, glass: 0.5}]\n",
         "surfaces: [{reflectance: 0.25, specular: 0.25, glass: 0.50001}]\n", "surfaces[0]"},
        {ANY, "surfaces: [{reflectance: 0.5, mirror: 0.5}]\n", "surfaces: [{reflectance: 0.5, mirror: 0.50001}]\n",
         "surfaces[0]"},
        {ANY, "surfaces: [{glass: 0.5, mirror: 0}]\n", "surfaces: [{glass: 0.5, mirror: 0.1}]\n", "surfaces[0].mirror"},
        {ANY, "surfaces: [{glass: 0, mirror: 0.5}]\n", "surfaces: [{glass: 0.1, mirror: 0.5}]\n", "surfaces[0].mirror"},
        {ANY, "signal: {extinction_1_km: 0}\n", "signal: {extinction_1_km: 0, visibility_m: 0}\n",
         "signal.extinction_1_km"},
    };
    ALL(bounds);
}

/* A window has at most 2048 samples around an echo, and 4095 in a gate. Light goes 0.149896229 m back and forth in
 * 1 ns. */
static void samples_of_waveforms(void **state)
{
    (void)state;
#define ON "signal: {model: on}\nwaveform: {send: on, "
    static const struct bound bounds[] = {
        {VZ, ON "before_ns: 1048, after_ns: 1000}\n", ON "before_ns: 1048.01, after_ns: 1000}\n", "waveform.after_ns"},
        {VZ, ON "before_ns: 2038}\n", ON "before_ns: 2038.01}\n", "waveform.before_ns"},
        {VZ, ON "before_ns: 12, after_ns: 90.4, sample_ns: 0.05}\n",
         ON "before_ns: 12.01, after_ns: 90.4, sample_ns: 0.05}\n", "waveform.after_ns"},
        {VZ, ON "far_m: 613.8250}\n", ON "far_m: 613.8251}\n", "waveform.far_m"},
        {VZ, ON "near_m: 10, far_m: 10.1499}\n", ON "near_m: 10, far_m: 10.1498}\n", "waveform.far_m"},
        {VZ, ON "near_m: 0, far_m: 0}\n", ON "near_m: 5}\n", "waveform.near_m"},
        {VZ, ON "near_m: 5, far_m: 6}\n", ON "near_m: 5, far_m: 5}\n", "waveform.far_m"},
        {VZ, ON "sample_ns: 0.051}\n", ON "sample_ns: 0.0515}\n", "waveform.sample_ns"},
        {VZ, ON "baseline_counts: 127.5, bits: 8}\n", ON "baseline_counts: 127.5625, bits: 8}\n",
         "waveform.baseline_counts"},
        {VZ, ON "baseline_counts: 0.0625}\n", ON "baseline_counts: 0.03125}\n", "waveform.baseline_counts"},
        {VZ, ON "bandwidth_mhz: 1}\n", ON "bandwidth_mhz: 0.999}\n", "waveform.bandwidth_mhz"},
        {VZ, ON "bandwidth_mhz: 0}\n", ON "bandwidth_mhz: 1e-9}\n", "waveform.bandwidth_mhz"},
        {VZ, ON "dead_ns: 0}\n", ON "dead_ns: 0.001}\n", "waveform.dead_ns"},
        {VZ, ON "dead_ns: 5, saturation_db: 0.1}\n", ON "dead_ns: 5, saturation_db: 0}\n", "waveform.dead_ns"},
        /* a window that can't be read is not looked at */
        {VZ, ON "far_m: 0}\n", ON "far_m: x, near_m: 9}\n", "waveform.far_m"},
        /* without waveforms, windows are not looked at */
        {VZ, "waveform: {before_ns: 4000}\n", ON "before_ns: 4000}\n", "waveform.before_ns"},
    };
    ALL(bounds);
}

static void platforms_and_time(void **state)
{
    (void)state;
#define PATH  "platform: {kind: trajectory, file: a, "
#define STOPS "platform: {kind: stops, file: a, "
    static const struct bound bounds[] = {
        {ANY, PATH "start_s: 2, end_s: 2.000001}\n", PATH "start_s: 2, end_s: 2}\n", "platform.end_s"},
        {ANY, STOPS "step_s: 1, start_s: 2, end_s: 2}\n", STOPS "step_s: 1, start_s: 2, end_s: 1.999}\n",
         "platform.end_s"},
        {ANY, STOPS "frames_per_s: 9, first_frame: 5, last_frame: 5, frame_step: 1}\n",
         STOPS "frames_per_s: 9, first_frame: 5, last_frame: 4.999, frame_step: 1}\n", "platform.last_frame"},
        {ANY, STOPS "step_s: 1e-9}\n", STOPS "step_s: 0}\n", "platform.step_s"},
        {ANY, STOPS "frames_per_s: 0, step_s: 1}\n", STOPS "frames_per_s: 0, step_s: 1, first_frame: 1}\n",
         "platform.first_frame"},
        {ANY, "platform: {kind: stops, step_s: 1, end_s: 0}\n", "platform: {kind: stops, step_s: 1}\n",
         "platform.kind"},
        {ANY, "loop: {tick_hz: 10000}\n", "loop: {tick_hz: 3000}\n", "loop.tick_hz"},
        {ANY, "loop: {tick_hz: 128}\n", "loop: {tick_hz: 128.5}\n", "loop.tick_hz"},
        {ANY, "gnss: {rate_hz: 4}\n", "gnss: {rate_hz: 3}\n", "gnss.rate_hz"},
        {ANY, "gnss: {rate_hz: 10}\n", "gnss: {rate_hz: 8}\n", "gnss.rate_hz"},
        {ANY, "gnss: {quality: 4}\n", "gnss: {quality: 3}\n", "gnss.quality"},
        {ANY, "gnss: {quality: 2}\n", "gnss: {quality: 3}\n", "gnss.quality"},
        {ANY, "ntp: {zone_h: -12}\n", "ntp: {zone_h: -11.5}\n", "ntp.zone_h"},
        {ANY, "ntp: {address: 255.255.255.255}\n", "ntp: {address: 255.255.255.2561}\n", "ntp.address"},
        {ANY, "time: {epoch: \"1980-01-06T00:00:01Z\"}\n", "time: {epoch: \"1980-01-06T00:00:00Z\"}\n", "time.epoch"},
    };
    ALL(bounds);
}

static void outputs_and_links(void **state)
{
    (void)state;
    static const char ours[] = "  - type: tcp\n    port: 0\n", crs[] = "  crs: local\n";
    static const struct {
        const char *at, *beyond, *key;
    } links[] = {
        {"  [{type: tcp, port: 5}, {type: web, port: 6}]\n", "  [{type: tcp, port: 5}, {type: web, port: 5}]\n",
         "links[1].port"},
        {"  [{type: tcp}, {type: tcp}]\n", "  [{type: tcp, port: 9}, {type: tcp, port: 9}]\n", "links[1].port"},
        {"  [{type: tcp, port: 5, address: 127.0.0.1}, {type: tcp, port: 5, address: 127.0.0.2}]\n",
         "  [{type: tcp, port: 5, address: 127.0.0.1}, {type: tcp, port: 5}]\n", "links[1].port"},
        {"  [{type: tcp, port: 5, address: 0.0.0.0}, {type: tcp, port: 6}]\n",
         "  [{type: tcp, port: 5, address: 0.0.0.0}, {type: tcp, port: 5}]\n", "links[1].port"},
        {"  [{type: tcp, port: 5}, {type: tcp, port: 6, address: 0.0.0.0}]\n",
         "  [{type: tcp, port: 5}, {type: tcp, port: 5, address: 0.0.0.0}]\n", "links[1].port"},
        {"  [{type: tcp, port: 5}, {type: \"null\"}]\n", "  [{type: web, port: 5}, {type: web, port: 5}]\n",
         "links[1].port"},
        {"  [{type: file, path: a}, {type: file, path: b}]\n", "  [{type: file, path: a}, {type: file, path: a}]\n",
         "links[1].path"},
    };
    static const struct {
        const char *at, *beyond, *key;
    } outputs[] = {
        {"  scale_m: 1e-6\n", "  scale_m: 9.99e-7\n", "output.scale_m"},
        {"  layout: geo\n  scale_m: 1e-6\n", "  layout: geo\n  scale_m: 9.99e-7\n", "output.scale_m"},
        {"  colour: solid\n  colour_rgb: [0, 255, 1]\n", "  colour: solid\n  colour_rgb: [0.5, 255, 1]\n",
         "output.colour_rgb"},
        {"  colour: solid\n  colour_rgb: [1, 2, 3]\n", "  colour: solid\n  colour_rgb: [1, 2.5, 3]\n",
         "output.colour_rgb"},
        {"  colour: solid\n  colour_rgb: [1, 2, 3]\n", "  colour: solid\n  colour_rgb: [1, 2, 3.5]\n",
         "output.colour_rgb"},
        {"  colour: range\n  colour_limits: [1, 1.001]\n", "  colour: range\n  colour_limits: [1, 1]\n",
         "output.colour_limits"},
        {"  colour: height\n  colour_limits: [-2, -1]\n", "  colour: height\n  colour_limits: [-1, -2]\n",
         "output.colour_limits"},
    };
    for (size_t i = 0; i < sizeof links / sizeof links[0]; i++) {
        expect_key(load_edited(ours, links[i].at), links[i].at, NULL);
        expect_key(load_edited(ours, links[i].beyond), links[i].beyond, links[i].key);
    }
    static const char *const sets[] = {"head={profile: velodyne-vlp16}",
                                       "links=[{type: udp, port: 1, protocol: velodyne}]", "links.0.port=0"};
    expect_key(load_sets(sets, 2), sets[1], NULL);
    assert_int_equal(load_sets(sets, 3), SH_EINPUT);
    expect_only("--set ", "links[0].port", "a udp link needs the port of its receiver; allowed 1 to 65535");
    for (size_t i = 0; i < sizeof outputs / sizeof outputs[0]; i++) {
        expect_key(load_edited(crs, outputs[i].at), outputs[i].at, NULL);
        expect_key(load_edited(crs, outputs[i].beyond), outputs[i].beyond, outputs[i].key);
    }
}

static void injected_faults(void **state)
{
    (void)state;
#define FAULT "faults: [{kind: "
    static const struct bound bounds[] = {
        {ANY, FAULT "drop, from: 5, until: 5}]\n", FAULT "drop, from: 5, until: 4}]\n", "faults[0].until"},
        {ANY, FAULT "drop, from: 5, until: 0}]\n", FAULT "drop, from: 5, until: 1}]\n", "faults[0].until"},
        {ANY, FAULT "drop, from_s: 5, until_s: 5.001}]\n", FAULT "drop, from_s: 5, until_s: 5}]\n",
         "faults[0].until_s"},
        {ANY, FAULT "drop, from_pulse: 5, until_pulse: 5}]\n", FAULT "drop, from_pulse: 5, until_pulse: 4}]\n",
         "faults[0].until_pulse"},
        {ANY, FAULT "drop, at: 0, every: 2}]\n", FAULT "drop, at: 1, every: 2}]\n", "faults[0].at"},
        {ANY, FAULT "drop, at: 0, from: 2}]\n", FAULT "drop, at: 1, from: 2}]\n", "faults[0].at"},
        {ANY, FAULT "drop, at: 0, until: 2}]\n", FAULT "drop, at: 1, until: 2}]\n", "faults[0].at"},
        /* 200 lines/s: 1.2 times that is 240, the most */
        {"any-rate", "  lines_hz: 200\n", FAULT "mirror_slow, factor: 1.2}]\n", FAULT "mirror_slow, factor: 1.2001}]\n",
         "faults[0].factor"},
        {"any-rate", "  lines_hz: 240\n", FAULT "mirror_slow, factor: 0.9999}]\n",
         FAULT "mirror_slow, factor: 1.0001}]\n", "faults[0].factor"},
        {ANY, "noise: {range: on}\n" FAULT "window_soiled}]\n", FAULT "window_soiled}]\n", "faults[0].kind"},
        {ANY, "noise: {range: on, sigma_m: 1e-9}\n" FAULT "window_soiled}]\n",
         "noise: {range: on, sigma_m: 0}\n" FAULT "window_soiled}]\n", "faults[0].kind"},
    };
    ALL(bounds);
}

static void figures_of_a_profile(void **state)
{
    (void)state;
    static const struct {
        const char *head, *old, *at, *beyond, *key;
    } bounds[] = {
        {"any-rate", "prr_min_hz: { value: 100000,", "prr_min_hz: { value: 1200000,", "prr_min_hz: { value: 1200001,",
         "prr_min_hz"},
        {"any-rate", "lines_min_hz: { value: 3,", "lines_min_hz: { value: 240,", "lines_min_hz: { value: 240.1,",
         "lines_min_hz"},
        {"any-rate", "range_min_m: { value: 1.5,", "range_min_m: { value: 799.9,", "range_min_m: { value: 800,",
         "range_min_m"},
        {"any-rate", "range_sigma_floor_m: { value: 0.00295,", "range_sigma_floor_m: { value: 0.003,",
         "range_sigma_floor_m: { value: 0.00301,", "range_sigma_floor_m"},
        {"any-rate", "fov_min_deg: { value: -40,", "fov_min_deg: { value: 59.999999,", "fov_min_deg: { value: 60,",
         "fov_min_deg"},
        {"any-rate", "fov_max_deg: { value: 60,", "fov_max_deg: { value: 200,", "fov_max_deg: { value: 200.000001,",
         "fov_max_deg"}, /* 240 deg of a sweep */
        {"any-rate", "pan_min_deg: { value: 0,", "pan_min_deg: { value: 359.999999,", "pan_min_deg: { value: 360,",
         "pan_max_deg"},
        {"any-rate", "pan_min_deg: { value: 0,", "pan_min_deg: { value: 0.0,", "pan_min_deg: { value: -0.000001,",
         "pan_max_deg"},
        {"any-rate", "optical_gain: { value: 2,", "optical_gain: { value: 3,", "optical_gain: { value: 3.01,",
         "optical_gain"}, /* 120 deg of a facet, three times: a turn */
        {"riegl-vz400i", "reach_90_m: { value: 800,", "reach_90_m: { value: 800.0,", "reach_90_m: { value: 800.1,",
         "programs[0].reach_90_m"},
        {"riegl-vz400i", "range_min_m: { value: 1.2,", "range_min_m: { value: 479.9,", "range_min_m: { value: 480,",
         "programs[1].range_min_m"},
        {"riegl-vz400i", "range_min_m: { value: 1.2,", "range_min_m: { value: 0.5,", "range_min_m: { value: 0.499,",
         "programs[1].range_min_m"},
        /* 125 kHz of 300 are in the field of view; within 2 % of that */
        {"riegl-vz400i", "used_hz: { value: 125000,", "used_hz: { value: 127500,", "used_hz: { value: 127501,",
         "programs[1].used_hz"},
        {"riegl-vz400i", "used_hz: { value: 125000,", "used_hz: { value: 122500,", "used_hz: { value: 122499,",
         "programs[1].used_hz"},
        {"riegl-vz400i", "prr_hz: { value: 300000,", "prr_hz: { value: 300000.0,", "prr_hz: { value: 100000,",
         "programs[1].prr_hz"},
        {"hokuyo-urg-04lx", "last_step: { value: 725,", "last_step: { value: 1023,", "last_step: { value: 1024,",
         "last_step"},
        {"hokuyo-urg-04lx", "first_step: { value: 44,", "first_step: { value: 724,", "first_step: { value: 725,",
         "first_step"},
        {"hokuyo-urg-04lx", "front_step: { value: 384,", "front_step: { value: 1023,", "front_step: { value: 1024,",
         "front_step"},
        {"sick-lms111", "lines_hz: 50,", "lines_hz: 50.0,", "lines_hz: 50.000001,", "geometries[0].lines_hz"},
    };
    for (size_t i = 0; i < sizeof bounds / sizeof bounds[0]; i++) {
        char place[96];
        const int code = load_changed(bounds[i].head, bounds[i].old, bounds[i].at);
        if (code != SH_OK) fail_msg("%s: %s", bounds[i].at, err.text);
        if (load_changed(bounds[i].head, bounds[i].old, bounds[i].beyond) == SH_OK)
            fail_msg("%s: taken", bounds[i].beyond);
        snprintf(place, sizeof place, ": %s: ", bounds[i].key);
        if (strstr(err.text, place) == NULL) fail_msg("%s: %s", bounds[i].beyond, err.text);
    }
}

/* A pulse has a width of 0.01 ns or more, or a table. */
static void a_pulse_has_a_width(void **state)
{
    (void)state;
    static const char *const widths[] = {"0.01", "0.0099", "0"}, *const more[] = {ON "}\n", "waveform: {}\n",
                                                                                  ON "pulse: table, pulse_file: a}\n"};
    for (int w = 0; w < 3; w++)
        for (int m = 0; m < 3; m++) {
            char with[64], want[200];
            char *text = read_source("config/heads/any-rate.yaml");
            snprintf(with, sizeof with, "pulse_width_ns: { value: %s,", widths[w]);
            char *changed = replaced(text, "pulse_width_ns: { value: 4,", with);
            write_in("heads/mine.yaml", changed);
            free(text);
            free(changed);
            const int code = load_with_head("mine", "", more[m]);
            if ((code == SH_OK) != (w == 0 || m > 0)) fail_msg("%s ns: %s", widths[w], err.text);
            if (code == SH_OK) continue;
            snprintf(
                want, sizeof want,
                "waveform.send: pulse_width_ns of head profile mine is %s; required is 0.01 or more, or waveform.pulse: "
                "table",
                widths[w]);
            assert_says(want);
        }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(settings_of_the_head), cmocka_unit_test(noise_signal_and_surfaces),
        cmocka_unit_test(samples_of_waveforms), cmocka_unit_test(platforms_and_time),
        cmocka_unit_test(outputs_and_links),    cmocka_unit_test(injected_faults),
        cmocka_unit_test(figures_of_a_profile), cmocka_unit_test(a_pulse_has_a_width),
    };
    return cmocka_run_group_tests_name("bounds", tests, set_up, tear_down);
}
