/* SPDX-License-Identifier: MIT */
/* A site's waveforms: the digitiser that the configuration describes, the pulse of a file, room for the samples of a
 * block, and what the plan says about them. */
#include "tests/unit/site_rig.h"

#include <math.h>

#include "core/plan/cost.h"
#include "core/waveform.h"
#include "firmware_sim/site/waves.h"

static struct site *site;

/* 100 deg of a sweep of 240 deg are used: 500,000 of 1,200,000 pulses/s are cast. */
static int load(const char *waveform, const char *more)
{
    char text[1024];
    site_free(site);
    site = NULL;
    write_in("floor.obj", "o floor\nv -30 -30 0\nv 30 -30 0\nv 30 30 0\nv -30 30 0\nf 1 2 3 4\n");
    snprintf(text, sizeof text,
             "head: {profile: riegl-vz400i, prr_hz: 1200000}\nscene:\n"
             "  meshes: [{file: floor.obj, up: z, scale: 1}]\ncast: {sight: off}\n"
             "stations: [{position_m: [0, 0, 2]}]\n%ssignal: {model: on}\nsurfaces: [{reflectance: 0.5}]\n"
             "waveform: {%s}\n%s",
             strstr(more, "beam:") == NULL ? "beam: {mode: single}\n" : "", waveform, more);
    write_in("test.yaml", text);
    clear_warned();
    if (config_load(config_path, NULL, 0, cfg, &err) != SH_OK) fail_msg("%s", err.text);
    return site_load(cfg, &report, &site, &err);
}

static const struct waveform_spec *spec_of(const char *waveform, const char *more)
{
    if (load(waveform, more) != SH_OK) fail_msg("%s", err.text);
    return waveform_spec_of(site->waves->waveform);
}

static void expect_near(double got, double want)
{
    if (!(fabs(got - want) <= 1e-14 * fabs(want))) fail_msg("%.17g instead of %.17g", got, want);
}

static void the_digitiser_is_that_of_the_configuration(void **state)
{
    (void)state;
    const struct waveform_spec *s =
        spec_of("send: on, pulse: asymmetric, skew: 1.7, bandwidth_mhz: 210, sample_ns: 0.8, bits: 10, "
                "baseline_counts: 37, full_scale_db: 33, saturation_db: 41, dead_ns: 12, keep_db: 3, before_ns: 7, "
                "after_ns: 9, near_m: 2, far_m: 31",
                "noise: {seed: 77}\n");
    assert_int_equal(s->shape, WAVEFORM_ASYMMETRIC);
    expect_near(s->width_s, 4e-9);
    expect_near(s->skew, 1.7);
    expect_near(s->bandwidth_hz, 210e6);
    expect_near(s->sample_s, 0.8e-9);
    assert_int_equal(s->bits, 10);
    expect_near(s->baseline_counts, 37);
    expect_near(s->full_scale, pow(10, 3.3));
    expect_near(s->saturation, pow(10, 4.1));
    expect_near(s->dead_s, 12e-9);
    expect_near(s->noise, 1.0 / cfg->profile.threshold_snr);
    expect_near(s->keep, pow(10, 0.3));
    expect_near(s->before_s, 7e-9);
    expect_near(s->after_s, 9e-9);
    assert_true(s->near_m == 2 && s->far_m == 31 && s->seed == 77);
    assert_int_equal(s->n_table, 0);
    s = spec_of("send: on", "");
    assert_int_equal(s->shape, WAVEFORM_GAUSSIAN);
    assert_true(s->saturation == 0 && s->near_m >= s->far_m);
}

/* ---- the pulse of a file */

static void write_pulse(const char *text)
{
    write_in("pulse.csv", text);
}

#define FROM_FILE "send: on, pulse: table, pulse_file: pulse.csv, bandwidth_mhz: 100"

static void a_pulse_is_read_from_a_file(void **state)
{
    (void)state;
    static const double power[5] = {0, 4, 3.5, 1, 0};
    write_pulse("power,t_ns\n0,-2\n4,-0.5\n3.5,1\n1,2.5\n0,4.01\n");
    const struct waveform_spec *s = spec_of(FROM_FILE, "");
    assert_int_equal(s->shape, WAVEFORM_TABLE);
    assert_int_equal(s->n_table, 5);
    for (int i = 0; i < 5; i++) /* any scale will do */
        expect_near(s->table[i] / s->table[1], power[i] / power[1]);
    expect_near(s->table_step_s, 1.5e-9);
}

static void refuse_pulse(const char *text, const char *says)
{
    write_pulse(text);
    assert_int_equal(load(FROM_FILE, ""), SH_EINPUT);
    const char *at = strstr(err.text, "/pulse.csv");
    if (at == NULL || strcmp(at + strlen("/pulse.csv"), says) != 0) fail_msg("%s", err.text);
}

static void lines_of_a_pulse_have_limits(void **state)
{
    (void)state;
    refuse_pulse("t_ns\n0\n1\n2\n", ": a column is missing; required are t_ns and power");
    refuse_pulse("power\n0\n1\n2\n", ": a column is missing; required are t_ns and power");
    refuse_pulse("t_ns,power\n0,1\n1,2\n", ": 2 lines; allowed are 3 to 1024");
    refuse_pulse("t_ns,power\n0,1\n1,-0.5\n2,0\n", ":3: a power of -0.5; allowed is 0 or more");
    refuse_pulse("t_ns,power\n3,1\n3,2\n3,0\n", ":3: t_ns is 3; allowed is more than 3");
    refuse_pulse("t_ns,power\n3,1\n2,2\n1,0\n", ":3: t_ns is 2; allowed is more than 3");
    refuse_pulse("t_ns,power\n3,0\n5,2\n7.03,0\n", ":4: t_ns is 7.03; allowed are times that rise by one step, here 7");
    refuse_pulse("t_ns,power\n3,0\n5,2\n6.97,0\n", ":4: t_ns is 6.97; allowed are times that rise by one step, here 7");
    /* A hundredth of a step is allowed. */
    write_pulse("t_ns,power\n3,0\n5,2\n7.01,1\n8.99,0\n");
    expect_near(spec_of(FROM_FILE, "")->table_step_s, 2e-9);
    for (int n = 1024; n <= 1025; n++) {
        char *text = malloc(32 * 1026), *end = text + sprintf(text, "t_ns,power\n");
        for (int i = 0; i < n; i++)
            end += sprintf(end, "%.2f,%d\n", 0.01 * i, i < 512 ? i : 1023 - i < 0 ? 0 : 1023 - i);
        if (n > 1024) {
            refuse_pulse(text, ":1026: too many lines; allowed are up to 1024");
        } else {
            write_pulse(text);
            assert_int_equal(spec_of(FROM_FILE, "")->n_table, 1024);
        }
        free(text);
    }
}

/* ---- usual pulses. A return of 20 dB is above the level of -6 dB as long as a Gaussian of 4 ns is within 26 dB of its
 * peak: 8 ns sqrt(26 / 12.04) = 11.8 ns. So with 5 ns before and 10 ns after there are 27 samples, at most. */

/* A window of n samples has 28 bytes and two for each of an even number of samples. */
static void expect_usual(const char *waveform, uint32_t samples, double bytes)
{
    spec_of(waveform, "");
    const struct site_wave_room one = site_usual_waves(site, 1), ten = site_usual_waves(site, 10);
    if (one.samples != samples) fail_msg("%s: %u samples", waveform, one.samples);
    assert_int_equal(one.windows, 1);
    assert_true(ten.windows == 10 && ten.samples == 10 * samples);
    expect_near(site_wave_bytes_s(site), 5e5 * bytes);
}

static void usual_pulses(void **state)
{
    (void)state;
    expect_usual("send: on", 27, 28 + 2 * 28);
    expect_usual("send: on, before_ns: 6", 28, 28 + 2 * 28);
    expect_usual("send: on, keep_db: 17", 19, 28 + 2 * 20); /* 4 ns */
    expect_usual("send: on, sample_ns: 0.5", 24 + 10 + 20, 28 + 2 * 54);
    /* The usual signal is doubled to 23.01 dB, which is above the level for 8 ns sqrt(1.01 / 12.04) = 2.3 ns. */
    expect_usual("send: on, keep_db: 22", 5 + 10 + 3, 28 + 2 * 18);
    /* Samples are 0.1499 m apart: the 14th lies beyond 2 m, the 206th before 31 m. */
    expect_usual("send: on, near_m: 2, far_m: 31", 193, 28 + 2 * 194);
}

/* A block has room for four usual windows of each pulse, if the head reports as many echoes. There is more room for
 * the most that one pulse can have. */
static void room_of_a_block(void **state)
{
    (void)state;
    static const struct {
        const char *waveform, *more;
        uint32_t each, samples;
    } is[] = {{"send: on", "", 1, 27},
              {"send: on", "beam: {mode: rings}\n", 4, 27},
              {"send: on, near_m: 2, far_m: 31", "beam: {mode: rings}\n", 1, 193}};
    for (size_t i = 0; i < sizeof is / sizeof is[0]; i++) {
        spec_of(is[i].waveform, is[i].more);
        for (uint32_t n = 0; n <= 1000; n += 500) {
            const struct site_wave_room room = site_wave_room(site, n);
            assert_int_equal(room.windows, n * is[i].each + 16);
            assert_int_equal(room.samples, n * is[i].each * is[i].samples + 8192);
        }
    }
    /* 2^30 samples at most: 3 windows of 27 samples are too many for 2^24 pulses. */
    spec_of("send: on", "beam: {mode: rings}\n");
    assert_int_equal(site_wave_room(site, 1 << 24).windows, (2 << 24) + 16);
    spec_of("send: off, echoes: fraction", "noise: {range: off}\n");
    assert_true(site_wave_room(site, 10).windows == 0 && site_wave_room(site, 10).samples == 0);
    assert_true(site_usual_waves(site, 10).windows == 0 && site_wave_bytes_s(site) == 0);
}

static void refuse_rate(const char *waveform, const char *says)
{
    assert_int_equal(load(waveform, ""), SH_EINPUT);
    const char *at = strstr(err.text, "test.yaml: ");
    if (at == NULL || strncmp(at + strlen("test.yaml: "), says, strlen(says)) != 0) fail_msg("%s", err.text);
}

static void a_stream_has_400_mb_of_waveforms_a_second(void **state)
{
    (void)state;
    refuse_rate("send: on, after_ns: 370",
                "waveform.after_ns: windows of 387 samples for 500000 pulses/s are 402 MB/s; allowed up to 400 MB/s");
    expect_usual("send: on, after_ns: 369", 386, 800);
    refuse_rate("send: on, near_m: 2, far_m: 61",
                "waveform.far_m: windows of 393 samples for 500000 pulses/s are 408 MB/s; allowed up to 400 MB/s");
    refuse_rate("send: on, sample_ns: 3", "waveform.sample_ns: samples 3 ns apart are too coarse");
}

/* ---- echoes from samples need a level above the noise */

static void a_bandwidth_that_is_advised_is_enough(void **state)
{
    (void)state;
    double mhz = 20.0, advised = 0.0;
    char waveform[96], says[320];
    for (int times = 0; times < 2; times++) {
        snprintf(waveform, sizeof waveform, "echoes: fraction, bandwidth_mhz: %.6f", mhz);
        const struct waveform_spec *s = spec_of(waveform, "noise: {range: off}\n");
        const double peak = waveform_pulse_peak(site->waves->waveform);
        if (times == 1) break;
        assert_true(peak < 5.0 * s->noise);
        snprintf(says, sizeof says,
                 "test.yaml: waveform.echoes: the level of an echo is %.2g times the noise (threshold_snr %.3g, times "
                 "%.2g, the peak of a pulse after the receiver): many echoes are of noise alone; at 5 times or more, "
                 "few are; waveform.bandwidth_mhz=",
                 peak * cfg->profile.threshold_snr, cfg->profile.threshold_snr, peak);
        const char *at = strstr(warned, says);
        if (at == NULL) fail_msg("%s instead of %s", warned, says);
        advised = strtod(at + strlen(says), NULL);
        assert_non_null(strstr(at, " is enough\n"));
        mhz = advised;
    }
    assert_string_equal(warned, "");
    snprintf(waveform, sizeof waveform, "echoes: fraction, bandwidth_mhz: %.6f", advised / 1.1 - 2.0); /* rounded up */
    spec_of(waveform, "noise: {range: off}\n");
    assert_non_null(strstr(warned, "many echoes are of noise alone"));
}

/* One part of a warning is there or not. */
static void expect_warned(const char *waveform, const char *says, int is_there)
{
    spec_of(waveform, "noise: {range: off}\n");
    if ((strstr(warned, says) != NULL) != is_there) fail_msg("%s: %s", waveform, warned);
}

/* The receiver has no limit of bandwidth, so an echo at the threshold has a signal of 0 dB. */
static void a_window_that_hides_echoes_is_told(void **state)
{
    (void)state;
    expect_warned("echoes: fraction, keep_db: 20", "waveform.keep_db: samples are kept from 20 dB above", 1);
    expect_warned("echoes: fraction, keep_db: 20", "at 0 dB or less, all are", 1);
    expect_warned("echoes: fraction, keep_db: 0", "keep_db", 0);
    expect_warned("send: on, keep_db: 20", "keep_db", 0); /* points come from the model */
    expect_warned("echoes: fraction, keep_db: 20, near_m: 2, far_m: 31", "keep_db", 0);
    /* The pulse of 4 ns becomes one of sqrt(4^2 + (0.312 / 0.05)^2) = 7.4 ns, and has 0.54 of its height: -2.7 dB. */
    expect_warned("echoes: fraction, keep_db: 0, bandwidth_mhz: 50", "at -2.7 dB or less", 1);
}

static void a_window_without_light_is_told(void **state)
{
    (void)state;
    char waveform[96];
    spec_of("send: on", "");
    const double most_m = cfg->profile.range_max_m;
    for (int beyond = 0; beyond < 2; beyond++) {
        snprintf(waveform, sizeof waveform, "send: on, near_m: %.10g, far_m: %.10g", most_m - !beyond, most_m + 10);
        expect_warned(waveform, "has no light; the ranges of head profile", beyond);
    }
}

/* A triangle is as wide at half of its height as half of its base. The profile's pulse has 4 ns. */
static void a_pulse_of_another_width_is_told(void **state)
{
    (void)state;
    assert_true(cfg->profile.pulse_width_ns == 4.0);
    write_pulse("t_ns,power\n0,0\n20,3\n40,0\n");
    expect_warned(FROM_FILE, "the pulse is 20 ns wide, but points are those of a pulse of 4 ns", 1);
    expect_warned(FROM_FILE ", echoes: gaussians", "ns wide", 0);
    write_pulse("t_ns,power\n0,0\n2,1\n4,2\n6,1\n8,0\n");
    expect_warned(FROM_FILE, "ns wide", 0);
    /* A table that begins or ends above half has its width up to there: from 0 to 20, and half of the last step. */
    write_pulse("t_ns,power\n0,3\n10,2.5\n20,4\n30,0\n");
    expect_warned(FROM_FILE, "the pulse is 25 ns wide", 1);
    write_pulse("t_ns,power\n0,0\n10,4\n20,2.5\n30,3\n");
    expect_warned(FROM_FILE, "the pulse is 25 ns wide", 1);
}

/* ---- blocks and the plan */

static void a_block_describes_the_digitiser(void **state)
{
    (void)state;
    struct caster *caster;
    for (int finds = 0; finds < 2; finds++)
        for (int attributes = 0; attributes < 2; attributes++) {
            struct line_block block;
            spec_of(
                finds
                    ? "send: on, sample_ns: 0.8, bits: 10, baseline_counts: 37.5, full_scale_db: 20, echoes: threshold"
                    : "send: on, sample_ns: 0.8, bits: 10, baseline_counts: 37.5, full_scale_db: 20",
                attributes ? "noise: {range: off}\noutput: {attributes: on}\n"
                           : "noise: {range: off}\noutput: {attributes: off, colour: reflectance}\n");
            assert_int_equal(caster_create(&caster, &err), SH_OK);
            assert_int_equal(site_make_block(site, 100, 300, caster, &block, &err), SH_OK);
            const struct site_wave_room room = site_wave_room(site, 100);
            assert_int_equal(block.capacity, 300);
            assert_true(block.waves->capacity == room.windows && block.waves->sample_capacity == room.samples);
            assert_true(block.waves->sample_ps == 800 && block.waves->bits == 10 && block.waves->baseline_16 == 600);
            expect_near((double)block.waves->count_signal, (double)(float)(100.0 / (1023 - 37.5)));
            assert_int_equal(block.width_cns != NULL, attributes);
            assert_int_equal(block.rgb != NULL, !attributes);
            assert_int_equal(block.deviation != NULL, finds && attributes);
            line_block_free(&block);
            caster_free(caster);
        }
    spec_of("echoes: fraction", "noise: {range: off}\n");
    struct line_block block;
    assert_int_equal(caster_create(&caster, &err), SH_OK);
    assert_int_equal(site_make_block(site, 100, 300, caster, &block, &err), SH_OK);
    assert_null(block.waves);
    line_block_free(&block);
    caster_free(caster);
}

static void the_plan_has_a_row(void **state)
{
    (void)state;
    static const char off[] = "noise: {range: off}\n", rings[] = "beam: {mode: rings}\n";
    const double wave_ns = PLAN_COST_WAVE + 27 * PLAN_COST_WAVE_SAMPLE;
    const struct {
        const char *waveform, *more, *method, *why;
        double cost_ns;
    } is[] = {
        {"send: on", "", "closed form",
         "27 samples for a usual pulse, 42 MB/s; single rays: an edge has no second return", wave_ns},
        {"send: on", rings, "sub-rays", "27 samples for a usual pulse, 42 MB/s", wave_ns},
        {"echoes: fraction", off, "closed form",
         "27 samples for a usual pulse; echoes are found in them, with the noise of the samples; single rays: an edge "
         "has no second return",
         wave_ns + PLAN_COST_FLANK},
        {"echoes: threshold", off, "closed form", NULL, wave_ns + PLAN_COST_FLANK},
        {"echoes: gaussians", off, "closed form", NULL, wave_ns + PLAN_COST_GAUSSIANS},
        {"send: off", "", "none", "waveform.send is off, and waveform.echoes is model", 0},
    };
    for (size_t i = 0; i < sizeof is / sizeof is[0]; i++) {
        struct plan_row row;
        if (load(is[i].waveform, is[i].more) != SH_OK) fail_msg("%s", err.text);
        site_wave_row(site, &row);
        assert_string_equal(row.stage, "waveform");
        assert_string_equal(row.method, is[i].method);
        if (is[i].why != NULL) assert_string_equal(row.why, is[i].why);
        expect_near(row.cost_ns, is[i].cost_ns);
        expect_near(site_wave_ns(site), is[i].cost_ns);
        const int finds = strstr(is[i].waveform, "echoes") != NULL;
        const double want_m = finds ? (double)NAN : i == 0 ? site->plan.beam.error_m : 0.0;
        assert_true(isnan(want_m) ? isnan(row.error_m) : row.error_m == want_m);
    }
}

static int teardown(void **state)
{
    site_free(site);
    return site_rig_teardown(state);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_digitiser_is_that_of_the_configuration),
        cmocka_unit_test(a_pulse_is_read_from_a_file),
        cmocka_unit_test(lines_of_a_pulse_have_limits),
        cmocka_unit_test(usual_pulses),
        cmocka_unit_test(room_of_a_block),
        cmocka_unit_test(a_stream_has_400_mb_of_waveforms_a_second),
        cmocka_unit_test(a_window_that_hides_echoes_is_told),
        cmocka_unit_test(a_window_without_light_is_told),
        cmocka_unit_test(a_pulse_of_another_width_is_told),
        cmocka_unit_test(a_bandwidth_that_is_advised_is_enough),
        cmocka_unit_test(a_block_describes_the_digitiser),
        cmocka_unit_test(the_plan_has_a_row),
    };
    return cmocka_run_group_tests_name("waves of a site", tests, site_rig_setup, teardown);
}
