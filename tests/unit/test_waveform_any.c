/* SPDX-License-Identifier: MIT */
/* Any spec that is accepted, any returns, any samples: windows stay in order, figures stay finite. */
#include <math.h>
#include <string.h>

#include "tests/common/cases.h"
#include "tests/common/thorough.h"
#include "tests/common/wave_echoes.h"

#include "core/light.h"

enum { ROOM = 4 * WAVEFORM_MAX_SAMPLES, PULSES = 6 };

static const enum waveform_detector all[WAVE_DETECTORS] = {WAVEFORM_THRESHOLD, WAVEFORM_FRACTION, WAVEFORM_GAUSSIANS};

/* Echoes in the order of range. Whatever the samples are, a centroid is no further from them than a pulse of as many
 * samples is long. */
static void check_echoes(const struct waveform_record *record, const struct waveform_echo *echo, uint32_t n,
                         double sample_m)
{
    const struct waveform_window *last = &record->window[record->n_windows - (n > 0)];
    for (uint32_t i = 0; i < n; i++) {
        const struct waveform_echo *e = &echo[i];
        if (!isfinite(e->range_m) || !isfinite(e->amplitude) || !isfinite(e->width_s) || !isfinite(e->deviation))
            fail_msg("echo %u of %u: range %g m, amplitude %g, width %g s, deviation %g", i, n, e->range_m,
                     e->amplitude, e->width_s, e->deviation);
        assert_true(e->amplitude > 0.0 && e->width_s > 0.0 && e->deviation >= 0.0);
        assert_true(i == 0 || e->range_m >= echo[i - 1].range_m);
        assert_true(e->range_m > (record->window[0].first - 1.0 * WAVEFORM_MAX_SAMPLES) * sample_m);
        assert_true(e->range_m < (last->first + last->n + 1.0 * WAVEFORM_MAX_SAMPLES) * sample_m);
    }
}

/* Noise of 8 times the level: a sample is above it, the next one below, and the level for a next echo is higher than
 * either. */
static void noise_above_the_level_is_taken(void **state)
{
    (void)state;
    struct waveform_spec spec = wave_spec();
    struct wave_echoes w;
    spec.noise = 8.0;
    spec.far_m = 60.0;
    wave_open(&w, &spec);
    for (int d = 0; d < WAVE_DETECTORS; d++)
        for (uint64_t p = 0; p < 100; p++) {
            const uint32_t n = wave_shoot(&w, all[d], p, NULL, 0);
            check_echoes(&w.record, w.echo, n, 0.5 * LIGHT_SPEED_M_S * spec.sample_s);
            if (all[d] == WAVEFORM_THRESHOLD) assert_int_equal(n, WAVE_MOST); /* of 200 maxima that noise has */
        }
    wave_close(&w);
}

/* A Gaussian of sigma 2 ns, and so much of another `apart` ns behind it: 0.2 ns a step. */
static void two_humps(double apart_ns, double second, double table[400])
{
    for (int i = 0; i < 400; i++) {
        const double t = 0.2 * i - 12.0, u = t - apart_ns;
        table[i] = exp(-0.125 * t * t) + second * exp(-0.125 * u * u);
    }
}

/* Two equal humps 24 ns apart have nothing at their centroid. One of 30 % leaves next to nothing there. The figures are
 * those of the pulse's first hump: threshold and fraction have the range from its flank. */
static void a_centroid_may_lie_in_a_gap(void **state)
{
    (void)state;
    static const double second[2] = {0.999, 0.3};
    for (int k = 0; k < 2; k++) {
        struct waveform_spec spec = wave_spec();
        struct wave_echoes w;
        double table[400];
        two_humps(24.0, second[k], table);
        spec.shape = WAVEFORM_TABLE;
        spec.table = table;
        spec.n_table = 400;
        spec.table_step_s = 0.2e-9;
        spec.noise = 0.02;
        wave_open(&w, &spec);
        wave_near(waveform_pulse_peak(w.waveform), 1.0, 1e-3);
        for (uint64_t p = 0; p < 20; p++) {
            const struct waveform_return r = {50.0 + 0.02 * (double)p, 30.0, 0.0, WAVEFORM_POINT};
            for (int d = 0; d < WAVE_DETECTORS; d++) {
                const uint32_t n = wave_shoot(&w, all[d], p, &r, 1);
                assert_true(n >= 1);
                check_echoes(&w.record, w.echo, n, 0.5 * LIGHT_SPEED_M_S * spec.sample_s);
                if (all[d] != WAVEFORM_GAUSSIANS) wave_near(w.echo[0].range_m, r.range_m, 0.05);
            }
        }
        wave_close(&w);
    }
}

/* A peak of 1 ns, and 2 % for 200 ns: the centroid is 80 widths behind the peak. Such a pulse has samples, and no
 * echoes. */
static void a_peak_far_from_the_centroid_is_said(void **state)
{
    (void)state;
    struct waveform_spec spec = wave_spec();
    struct wave_echoes w;
    struct sh_err err;
    double table[1000];
    for (int i = 0; i < 1000; i++)
        table[i] = exp(-0.5 * pow((0.2 * i - 3.0) / 0.5, 2)) + (i > 15 ? 0.02 : 0.0);
    spec.shape = WAVEFORM_TABLE;
    spec.table = table;
    spec.n_table = 1000;
    spec.table_step_s = 0.2e-9;
    spec.sample_s = 0.3e-9;
    wave_open(&w, &spec);
    const struct waveform_return r = {50.0, 30.0, 0.0, WAVEFORM_POINT};
    for (int d = 0; d < WAVE_DETECTORS; d++)
        assert_int_equal(wave_shoot(&w, all[d], 1, &r, 1), 0);
    assert_true(w.record.n_samples > 20);
    assert_int_equal(waveform_check_detection(w.waveform, &err), SH_EINPUT);
    assert_non_null(strstr(err.text, "too far from its centroid"));
    wave_close(&w);
    spec = wave_spec();
    wave_open(&w, &spec);
    assert_int_equal(waveform_check_detection(w.waveform, &err), SH_OK);
    wave_close(&w);
}

/* ---- anything */

/* low .. high, evenly in its logarithm. */
static double any_of(uint64_t *seed, double low, double high)
{
    return low * pow(high / low, case_unit(seed));
}

static int chance(uint64_t *seed, double part)
{
    return case_unit(seed) < part;
}

/* Tables of rubbish, and Gaussians. */
static uint32_t any_table(uint64_t *seed, double table[WAVEFORM_MAX_TABLE])
{
    const uint32_t n = (uint32_t)case_between(seed, 2, chance(seed, 0.5) ? 8 : WAVEFORM_MAX_TABLE);
    const int bell = chance(seed, 0.4);
    for (uint32_t i = 0; i < n; i++) {
        const double x = (i - 0.5 * n) / (0.12 * n);
        table[i] = bell ? exp(-0.5 * x * x) : chance(seed, 0.1) ? 0.0 : case_unit(seed);
    }
    return n;
}

static struct waveform_spec any_spec(uint64_t *seed, double table[WAVEFORM_MAX_TABLE])
{
    struct waveform_spec s = {.shape = (enum waveform_shape)case_between(seed, 0, 2), .table = table, .seed = 1};
    s.width_s = any_of(seed, 1e-10, 1e-7);
    s.skew = 1.0 + 2.0 * case_unit(seed);
    s.n_table = any_table(seed, table);
    s.sample_s = s.width_s * any_of(seed, 0.05, 0.6);
    s.table_step_s = s.sample_s * any_of(seed, 0.05, 3.0);
    s.bandwidth_hz = chance(seed, 0.4) ? 0.0 : any_of(seed, 0.02, 2.0) / s.width_s;
    s.sample_s = fmax(s.sample_s, 5e-11);
    s.bits = (uint32_t)case_between(seed, 8, 14);
    s.baseline_counts = chance(seed, 0.3) ? 0.0 : case_unit(seed) * 0.5 * ((1 << s.bits) - 1);
    s.full_scale = any_of(seed, 1e-3, 1e6);
    s.saturation = chance(seed, 0.5) ? 0.0 : any_of(seed, 1e-2, 1e6);
    s.dead_s = s.saturation > 0.0 && chance(seed, 0.6) ? s.sample_s * any_of(seed, 0.1, 1e3) : 0.0;
    s.noise = chance(seed, 0.3) ? 0.0 : any_of(seed, 1e-3, 10.0);
    s.keep = any_of(seed, 1e-6, 1e3);
    s.before_s = fmin(1e-5, any_of(seed, 0.1, 300.0) * s.sample_s);
    s.after_s = fmin(1e-5, any_of(seed, 0.1, 300.0) * s.sample_s);
    s.near_m = 1000.0 * case_unit(seed);
    if (chance(seed, 0.3)) s.far_m = s.near_m + any_of(seed, 1.0, 1000.0) * 0.5 * LIGHT_SPEED_M_S * s.sample_s;
    return s;
}

static uint32_t any_returns(uint64_t *seed, double sample_m, struct waveform_return returns[32])
{
    const uint32_t n = (uint32_t)case_between(seed, 0, chance(seed, 0.3) ? 32 : 3);
    const double base_m = any_of(seed, 0.1, 2000.0);
    for (uint32_t i = 0; i < n; i++) {
        returns[i].range_m = base_m + case_unit(seed) * sample_m * any_of(seed, 1.0, 1000.0);
        returns[i].amplitude = chance(seed, 0.05) ? 0.0 : any_of(seed, 1e-3, 1e6);
        returns[i].extent_m = chance(seed, 0.3) ? 0.0 : sample_m * any_of(seed, 1e-3, 1e2);
        returns[i].spread = (enum waveform_spread)case_between(seed, 0, 2);
    }
    return n;
}

static void check_windows(const struct waveform_record *record)
{
    uint32_t end = 0, n = 0;
    for (uint32_t i = 0; i < record->n_windows; i++) {
        const struct waveform_window *window = &record->window[i];
        assert_true(window->n > 0 && window->n <= WAVEFORM_MAX_SAMPLES);
        assert_true(window->first >= end && window->at == n);
        end = window->first + window->n;
        n += window->n;
    }
    assert_true(n == record->n_samples && n <= record->capacity);
}

static void any_pulse(uint64_t *seed, const struct waveform *w, uint64_t pulse)
{
    static uint16_t sample[ROOM];
    const struct waveform_spec *spec = waveform_spec_of(w);
    const double sample_m = 0.5 * LIGHT_SPEED_M_S * spec->sample_s;
    struct waveform_return returns[32];
    struct waveform_record record = {.sample = sample, .capacity = ROOM};
    if (chance(seed, 0.1)) record.capacity = (uint32_t)case_between(seed, 0, 100);
    const uint32_t n = any_returns(seed, sample_m, returns);
    waveform_sample(w, 0, pulse, returns, n, &record);
    check_windows(&record);
    if (chance(seed, 0.2))
        for (uint32_t i = 0; i < record.n_samples; i++)
            sample[i] = (uint16_t)case_between(seed, 0, (1 << spec->bits) - 1);
    for (int d = 0; d < WAVE_DETECTORS; d++) {
        struct waveform_echo echo[WAVE_MOST];
        uint32_t crowded = 0;
        const uint32_t most = (uint32_t)case_between(seed, 1, WAVE_MOST);
        const uint32_t found = waveform_detect(w, all[d], &record, echo, most, &crowded);
        assert_true(found <= most);
        check_echoes(&record, echo, found, sample_m);
    }
}

/* A third of the specs is refused: samples too coarse, pulses too long. */
static void anything_has_figures(void **state)
{
    (void)state;
    const int turns = thorough(20000, fewer(300));
    int made = 0;
    for (int turn = 0; turn < turns; turn++) {
        double table[WAVEFORM_MAX_TABLE];
        uint64_t seed = (uint64_t)turn;
        struct waveform *w;
        struct sh_err err;
        const struct waveform_spec spec = any_spec(&seed, table);
        if (waveform_create(&spec, &w, &err) != SH_OK) continue;
        made++;
        for (uint64_t p = 0; p < PULSES; p++)
            any_pulse(&seed, w, p);
        waveform_free(w);
    }
    assert_true(made > turns / 3);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(noise_above_the_level_is_taken),
        cmocka_unit_test(a_centroid_may_lie_in_a_gap),
        cmocka_unit_test(a_peak_far_from_the_centroid_is_said),
        cmocka_unit_test(anything_has_figures),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
