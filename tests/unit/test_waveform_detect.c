/* SPDX-License-Identifier: MIT */
/* Echoes found in samples, one property at a time: places at windows' ends, room, flags, levels, windows of noise. */
#include <math.h>
#include <string.h>

#include "tests/common/cases.h"
#include "tests/common/thorough.h"
#include "tests/common/wave_echoes.h"

#include "core/light.h"

static const enum waveform_detector all[WAVE_DETECTORS] = {WAVEFORM_THRESHOLD, WAVEFORM_FRACTION, WAVEFORM_GAUSSIANS};

static double sample_m(const struct wave_echoes *w)
{
    return 0.5 * LIGHT_SPEED_M_S * waveform_spec_of(w->waveform)->sample_s;
}

/* Without noise the digits alone are in the way: steps of 0.006 thresholds. Where a Gaussian
 * of 50 is at 0.35, below the level, it rises by 0.6 a sample, so half a step is 0.005 samples. */
static void a_plain_echo_is_where_it_is(void **state)
{
    (void)state;
    struct waveform_spec spec = wave_spec();
    struct wave_echoes w;
    spec.noise = 0.0;
    spec.bits = 14;
    wave_open(&w, &spec);
    for (int d = 0; d < WAVE_DETECTORS; d++)
        for (int k = 0; k < 50; k++) {
            const struct waveform_return r = {100.0 + 0.02 * k * sample_m(&w), 50.0, 0.0, WAVEFORM_POINT};
            assert_int_equal(wave_shoot(&w, all[d], 1, &r, 1), 1);
            wave_near(w.echo[0].range_m, r.range_m, 1.5e-3);
            wave_near(w.echo[0].amplitude, 50.0, 0.5);
            wave_near(w.echo[0].width_s, 4e-9, 0.05e-9);
            assert_true(w.echo[0].deviation < 0.005);
            assert_int_equal(w.echo[0].saturated, 0);
        }
    wave_close(&w);
}

/* The receiver's bandwidth lowers the pulse, but a surface that is hit head on still has its A. */
static void the_amplitude_is_that_of_the_link_budget(void **state)
{
    (void)state;
    struct waveform_spec spec = wave_spec();
    struct wave_echoes w;
    spec.noise = 0.0;
    spec.bandwidth_hz = 100e6;
    wave_open(&w, &spec);
    const struct waveform_return r = {50.0, 20.0, 0.0, WAVEFORM_POINT};
    assert_true(waveform_signal(w.waveform, &r, 1, 50.0) < 18.0);
    for (int d = 0; d < WAVE_DETECTORS; d++) {
        assert_int_equal(wave_shoot(&w, all[d], 1, &r, 1), 1);
        wave_near(w.echo[0].amplitude, 20.0, 0.3);
        wave_near(w.echo[0].range_m, 50.0, 2e-3);
    }
    wave_close(&w);
}

/* Samples that a caller has: counts of a Gaussian on a window of its own. */
static void put_window(struct wave_echoes *w, uint32_t first, uint32_t n, double at, double peak)
{
    const struct waveform_spec *spec = waveform_spec_of(w->waveform);
    const double most = (double)((1 << spec->bits) - 1), sigma = wave_sigma(spec->width_s / spec->sample_s);
    struct waveform_record *r = &w->record;
    struct waveform_window *window = &r->window[r->n_windows++];
    *window = (struct waveform_window){first, n, r->n_samples};
    for (uint32_t i = 0; i < n; i++) {
        double d = (first + i - at) / sigma, y = peak * exp(-0.5 * d * d);
        double count = spec->baseline_counts + y * (most - spec->baseline_counts) / spec->full_scale;
        r->sample[r->n_samples++] = (uint16_t)fmin(most, floor(count + 0.5));
    }
}

static void clear(struct wave_echoes *w)
{
    w->record.n_windows = w->record.n_samples = 0;
}

/* Windows that begin or end within an echo: where a flank and the top are seen, the range holds. Where the top is cut
 * off, the flank of a pulse of known width still gives it to a quarter of a sample. */
static void an_echo_at_a_border_is_found(void **state)
{
    (void)state;
    struct waveform_spec spec = wave_spec();
    struct wave_echoes w;
    spec.noise = 0.02;
    wave_open(&w, &spec);
    for (int d = 0; d < WAVE_DETECTORS; d++)
        for (int cut = -2; cut <= 8; cut++)
            for (int side = 0; side < 2; side++) {
                clear(&w);
                if (side == 0) put_window(&w, (uint32_t)(1000 + cut), 40, 1002.3, 30.0);
                if (side == 1) put_window(&w, 960, (uint32_t)(47 - cut), 1003.7, 30.0);
                int hidden = cut >= 3;
                uint32_t n = wave_detect(&w, all[d]);
                if (cut > 4) { /* a rest of a flank alone */
                    assert_true(n <= 1);
                    continue;
                }
                assert_int_equal(n, 1);
                double want = (side == 0 ? 1002.3 : 1003.7) * sample_m(&w);
                wave_near(w.echo[0].range_m, want, hidden ? 0.25 * sample_m(&w) : 0.02);
            }
    wave_close(&w);
}

/* Each window counts, wherever its samples lie in the array; echoes come in the order of range. */
static void windows_are_one_pulse(void **state)
{
    (void)state;
    const struct waveform_spec spec = wave_spec();
    struct wave_echoes w;
    wave_open(&w, &spec);
    for (int d = 0; d < WAVE_DETECTORS; d++) {
        clear(&w);
        put_window(&w, 100, 40, 120.25, 20.0);
        put_window(&w, 5000, 64, 5030.5, 5.0);
        put_window(&w, 90000, 30, 90015.0, 40.0);
        assert_int_equal(wave_detect(&w, all[d]), 3);
        static const double at[3] = {120.25, 5030.5, 90015.0};
        for (int k = 0; k < 3; k++)
            wave_near(w.echo[k].range_m, at[k] * sample_m(&w), 2e-3);
    }
    wave_close(&w);
}

static void the_weakest_are_left_out(void **state)
{
    (void)state;
    const struct waveform_spec spec = wave_spec();
    static const double peak[5] = {20.0, 5.0, 30.0, 3.0, 10.0};
    struct wave_echoes w;
    wave_open(&w, &spec);
    for (int d = 0; d < WAVE_DETECTORS; d++) {
        clear(&w);
        for (uint32_t k = 0; k < 5; k++)
            put_window(&w, 1000 * (k + 1), 40, 1000.0 * (k + 1) + 20.0, peak[k]);
        w.most = 3;
        assert_int_equal(wave_detect(&w, all[d]), 3);
        assert_int_equal(w.n_crowded, 2);
        static const double left[3] = {20.0, 30.0, 10.0};
        for (int k = 0; k < 3; k++)
            wave_near(w.echo[k].amplitude, left[k], 0.3);
        w.most = 0;
        assert_int_equal(wave_detect(&w, all[d]), 0);
        assert_int_equal(w.n_crowded, 5);
    }
    wave_close(&w);
}

/* 400 windows of 400 samples of noise. A sample exceeds 8 sigma once in 10^15; a fit of several has less noise. */
static void noise_is_no_echo(void **state)
{
    (void)state;
    struct waveform_spec spec = wave_spec();
    struct wave_echoes w;
    spec.far_m = 60.0;
    wave_open(&w, &spec);
    for (int d = 0; d < WAVE_DETECTORS; d++)
        for (uint64_t p = 0; p < 400; p++) {
            assert_int_equal(wave_shoot(&w, all[d], p, NULL, 0), 0);
            assert_true(w.record.n_samples >= 400);
        }
    wave_close(&w);
}

/* The tail of an asymmetric pulse takes 20 samples to fall through the level, with noise on it. */
static void a_tail_is_no_echo(void **state)
{
    (void)state;
    struct waveform_spec spec = wave_spec();
    struct wave_echoes w;
    spec.shape = WAVEFORM_ASYMMETRIC;
    spec.skew = 2.0;
    spec.sample_s = 0.5e-9;
    wave_open(&w, &spec);
    for (int d = 0; d < WAVE_DETECTORS; d++)
        for (uint64_t p = 0; p < 2000; p++) {
            const struct waveform_return r = {30.0 + 1e-4 * (double)p, 10.0 + 0.03 * (double)p, 0.0, WAVEFORM_POINT};
            assert_int_equal(wave_shoot(&w, all[d], p, &r, 1), 1);
        }
    wave_close(&w);
}

/* Strong echoes have a tail above the level that is more than 4 widths of the pulse long, within a window of 80 ns. A
 * fit knows it as a part of the pulse. */
static void a_long_tail_is_no_echo(void **state)
{
    (void)state;
    struct waveform_spec spec = wave_spec();
    struct wave_echoes w;
    spec.shape = WAVEFORM_ASYMMETRIC;
    spec.skew = 2.5;
    spec.sample_s = 0.5e-9;
    spec.after_s = 80e-9;
    wave_open(&w, &spec);
    for (uint64_t p = 0; p < 200; p++) {
        const struct waveform_return r = {30.0 + 1e-3 * (double)p, 200.0, 0.0, WAVEFORM_POINT};
        assert_int_equal(wave_shoot(&w, WAVEFORM_GAUSSIANS, p, &r, 1), 1);
    }
    wave_close(&w);
}

/* Half of the pulses see a target at the level; twice the level is 8 sigma above it, half of it 4 below. A fit has less
 * noise than a sample; a sample near the top is up to 3 % lower. */
static void the_level_decides(void **state)
{
    (void)state;
    const struct waveform_spec spec = wave_spec();
    const uint32_t n = (uint32_t)fewer(4000);
    struct wave_echoes w;
    struct wave_figures f;
    wave_open(&w, &spec);
    struct waveform_return r = {30.0, 1.0, 0.0, WAVEFORM_POINT};
    wave_measure(&w, WAVEFORM_GAUSSIANS, n, &r, &f);
    /* 4.75 standard errors, and the 3 % of noise that a width of its own lets into the peak */
    wave_near(f.single / (double)n, 0.5, 4.75 * 0.5 / sqrt(n) + 0.08);
    for (int d = 0; d < WAVE_DETECTORS; d++) {
        r.amplitude = 2.0;
        wave_measure(&w, all[d], n, &r, &f);
        assert_true(f.single >= n - 3);
        r.amplitude = 0.4;
        wave_measure(&w, all[d], n, &r, &f);
        assert_true(f.single <= n / 1000 + 2);
    }
    wave_close(&w);
}

/* Two pulses apart become two echoes; how far apart they have to be depends on the detector. */
static void two_surfaces_are_two_echoes(void **state)
{
    (void)state;
    const struct waveform_spec spec = wave_spec();
    static const double apart_widths[WAVE_DETECTORS] = {3.0, 1.5, 1.2};
    struct wave_echoes w;
    wave_open(&w, &spec);
    const double width_m = 0.5 * LIGHT_SPEED_M_S * spec.width_s;
    for (int d = 0; d < WAVE_DETECTORS; d++)
        for (uint64_t p = 0; p < 40; p++) {
            const double near_m = 20.0 + 0.025 * (double)p * sample_m(&w);
            const struct waveform_return r[2] = {{near_m, 30.0, 0.0, WAVEFORM_POINT},
                                                 {near_m + apart_widths[d] * width_m, 20.0, 0.0, WAVEFORM_POINT}};
            assert_int_equal(wave_shoot(&w, all[d], p, r, 2), 2);
            wave_near(w.echo[0].range_m, r[0].range_m, 0.05);
            wave_near(w.echo[1].range_m, r[1].range_m, 0.05);
        }
    wave_close(&w);
}

/* The weak one in the middle has no maximum of its own. */
static void three_surfaces_are_three_echoes(void **state)
{
    (void)state;
    struct waveform_spec spec = wave_spec();
    spec.noise = 0.03; /* widths of three that overlap take much of it */
    struct wave_echoes w;
    wave_open(&w, &spec);
    const double width_m = 0.5 * LIGHT_SPEED_M_S * spec.width_s;
    for (uint64_t p = 0; p < 40; p++) {
        struct waveform_return r[3];
        static const double amplitude[3] = {60.0, 15.0, 40.0};
        for (int k = 0; k < 3; k++)
            r[k] = (struct waveform_return){20.0 + 0.025 * (double)p * sample_m(&w) + 1.1 * k * width_m, amplitude[k],
                                            0.0, WAVEFORM_POINT};
        assert_int_equal(wave_shoot(&w, WAVEFORM_GAUSSIANS, p, r, 3), 3);
        for (int k = 0; k < 3; k++)
            wave_near(w.echo[k].range_m, r[k].range_m, 0.05);
    }
    wave_close(&w);
}

/* The returns are about a width apart or more, 0.6 m, and have no noise. Some fits take a term too many on the way, and
 * remove it again. Others end where a fit with one term less is nearly as good. Digits of 14 bits are steps of 0.006
 * thresholds, which is less than 0.1 mm at the slopes of these pulses. What remains is the fit's end, for which 10 mm
 * are allowed. */
static void overlapping_surfaces_are_all_found(void **state)
{
    (void)state;
    static const struct {
        uint32_t n;
        double range_m[4], amplitude[4];
    } cases[] = {{3, {0.003, 0.689, 1.319}, {30.3, 25.3, 39.8}},
                 {3, {0.053, 0.652, 1.261}, {10.8, 27.9, 28.4}},
                 {3, {0.127, 0.796, 1.506}, {12.2, 17.6, 15.4}},
                 {3, {0.142, 0.844, 1.484}, {28.0, 22.2, 22.9}},
                 {3, {0.071, 0.633, 1.350}, {14.9, 36.7, 39.0}},
                 {4, {0.007, 0.634, 1.279, 2.211}, {27.2, 39.3, 29.3, 34.3}},
                 {4, {0.003, 0.794, 1.585, 2.182}, {17.7, 22.8, 16.4, 37.2}},
                 {4, {0.077, 0.719, 1.378, 2.162}, {17.5, 14.9, 10.0, 21.8}},
                 {4, {0.149, 0.803, 1.476, 2.098}, {25.9, 37.9, 32.0, 22.8}}};
    struct waveform_spec spec = wave_spec();
    struct wave_echoes w;
    spec.noise = 0.0;
    spec.bits = 14;
    wave_open(&w, &spec);
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        struct waveform_return r[4];
        for (uint32_t k = 0; k < cases[i].n; k++)
            r[k] = (struct waveform_return){80.0 + cases[i].range_m[k], cases[i].amplitude[k], 0.0, WAVEFORM_POINT};
        assert_int_equal(wave_shoot(&w, WAVEFORM_GAUSSIANS, 1, r, cases[i].n), cases[i].n);
        for (uint32_t k = 0; k < cases[i].n; k++)
            wave_near(w.echo[k].range_m, r[k].range_m, 0.010);
    }
    wave_close(&w);
}

/* RIEGL's pulse shape deviation is small on one flat surface, and large where two surfaces make one echo. */
static void the_deviation_shows_mixed_echoes(void **state)
{
    (void)state;
    const struct waveform_spec spec = wave_spec();
    struct wave_echoes w;
    wave_open(&w, &spec);
    const double width_m = 0.5 * LIGHT_SPEED_M_S * spec.width_s;
    for (int d = 0; d < WAVE_DETECTORS; d++) {
        const struct waveform_return r[2] = {{20.0, 40.0, 0.0, WAVEFORM_POINT},
                                             {20.0 + 0.8 * width_m, 25.0, 0.0, WAVEFORM_POINT}};
        assert_int_equal(wave_shoot(&w, all[d], 1, r, 1), 1);
        /* The noise is 1/8 in an echo of 40. A wrong place adds the slope of h times that, at most 1.4 / width. */
        const double off = fabs(w.echo[0].range_m - r[0].range_m) / width_m;
        assert_true(w.echo[0].deviation < 2.0 * 0.125 / 40.0 + 1.4 * off);
        if (all[d] == WAVEFORM_GAUSSIANS) continue; /* separates them */
        assert_int_equal(wave_shoot(&w, all[d], 1, r, 2), 1);
        assert_true(w.echo[0].deviation > 0.1);
    }
    wave_close(&w);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_plain_echo_is_where_it_is),
        cmocka_unit_test(the_amplitude_is_that_of_the_link_budget),
        cmocka_unit_test(an_echo_at_a_border_is_found),
        cmocka_unit_test(windows_are_one_pulse),
        cmocka_unit_test(the_weakest_are_left_out),
        cmocka_unit_test(noise_is_no_echo),
        cmocka_unit_test(a_tail_is_no_echo),
        cmocka_unit_test(a_long_tail_is_no_echo),
        cmocka_unit_test(the_level_decides),
        cmocka_unit_test(two_surfaces_are_two_echoes),
        cmocka_unit_test(three_surfaces_are_three_echoes),
        cmocka_unit_test(overlapping_surfaces_are_all_found),
        cmocka_unit_test(the_deviation_shows_mixed_echoes),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
