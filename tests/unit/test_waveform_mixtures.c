/* SPDX-License-Identifier: MIT */
/* Sums of terms that are fitted to samples (core/waveform/detect_inside.h): known sums of Gaussians are found again. */
#include <math.h>
#include <string.h>

#include "tests/unit/finder_rig.h"

enum { N = 120 };

static struct waveform *w;
static double y[N];

/* A pulse of 4 samples, with noise of 0.01 thresholds; the digits are limited at 10. */
static int open_pulse(void **state)
{
    (void)state;
    w = finder_rig_open(0.01);
    return 0;
}

static int close_pulse(void **state)
{
    (void)state;
    waveform_free(w);
    return 0;
}

static void set_sum(const struct finder_term *g, uint32_t n)
{
    for (int i = 0; i < N; i++) {
        y[i] = 0.0;
        for (uint32_t j = 0; j < n; j++)
            y[i] += g[j].peak * exp(-0.5 * pow((i - g[j].at) / g[j].sigma, 2.0));
    }
}

static struct finder_run window(const uint8_t *mark)
{
    return (struct finder_run){finder_rig_of(w), y, N, mark, 0.0};
}

/* Terms may come in any order. */
static void expect_terms(const struct finder_mix *mix, const struct finder_term *want, uint32_t n, double most)
{
    assert_int_equal(mix->n, n);
    for (uint32_t j = 0; j < n; j++) {
        uint32_t k = 0;
        while (k < n && !(fabs(mix->g[k].at - want[j].at) < most && fabs(mix->g[k].sigma - want[j].sigma) < most &&
                          fabs(mix->g[k].peak - want[j].peak) < most * want[j].peak))
            k++;
        if (k == n)
            fail_msg("no term at %g; the first: %g %g %g", want[j].at, mix->g[0].at, mix->g[0].sigma, mix->g[0].peak);
    }
}

/* From a rough beginning the fit comes to the sum that the samples are, in any part of the window. */
static void a_sum_is_fitted(void **state)
{
    (void)state;
    static const struct finder_term want[3] = {{60.3, 1.8, 5.0}, {66.9, 2.4, 3.0}, {75.2, 1.7, 7.0}};
    const uint8_t mark[N] = {0};
    const struct finder_run run = window(mark);
    set_sum(want, 3);
    for (uint32_t lo = 0; lo <= 50; lo += 25) {
        const struct finder_task task = {&run, lo, 95, 1e-4};
        struct finder_mix mix = {.n = 3, .g = {{60.8, 2.1, 4.0}, {66.2, 2.0, 3.6}, {75.6, 2.0, 6.0}}};
        double rest[N];
        finder_mix_fit(&task, &mix);
        expect_terms(&mix, want, 3, 1e-3);
        assert_true(mix.chi2 < 1e-4);
        /* One term leaves the other two. */
        mix = (struct finder_mix){.n = 1, .g = {want[0]}};
        finder_mix_rest(&task, &mix, rest);
        for (uint32_t i = lo; i <= 95; i++) {
            const double left = want[1].peak * exp(-0.5 * pow((i - want[1].at) / want[1].sigma, 2.0)) +
                                want[2].peak * exp(-0.5 * pow((i - want[2].at) / want[2].sigma, 2.0));
            assert_true(fabs(rest[i - lo] - left) < 1e-4);
        }
    }
}

/* A sigma that is not that of the pulse adds to the sum of squares: by the variance times (ln(ratio) / 2)^2. The true
 * term leaves nothing else, so the fit's sum is up to that. */
static void a_wide_term_costs(void **state)
{
    (void)state;
    static const double variance = 1e-4;
    const double s = finder_rig_of(w)->spread[0].sigma;
    const struct finder_run run = window(NULL);
    for (int k = 0; k < 3; k++) {
        const double ratio = k == 0 ? 1.5 : k == 1 ? 2.0 : 3.0, q = 0.5 * log(ratio);
        const struct finder_term want = {60.3, ratio * s, 5.0};
        const struct finder_task task = {&run, 20, 100, variance};
        struct finder_mix mix = {.n = 1, .g = {{60.8, 1.2 * ratio * s, 4.0}}};
        set_sum(&want, 1);
        finder_mix_fit(&task, &mix);
        expect_terms(&mix, &want, 1, 1e-3);
        assert_true(mix.chi2 > 0.9 * variance * q * q && mix.chi2 <= 1.001 * variance * q * q);
    }
}

/* The number of terms is not known: there is one maximum for each echo, or fewer. */
static void sums_are_taken_apart(void **state)
{
    (void)state;
    const double s = finder_rig_of(w)->spread[0].sigma, width = 2.3548 * s;
    const struct {
        uint32_t n, peaks;
        struct finder_term g[3];
    } is[] = {{1, 1, {{70.3, s, 6.0}}},
              {2, 1, {{70.3, s, 6.0}, {70.3 + 1.0 * width, s, 4.0}}},
              {2, 1, {{70.3, s, 3.0}, {70.3 + 1.0 * width, s, 7.0}}},
              {2, 2, {{70.3, s, 6.0}, {70.3 + 2.0 * width, s, 4.0}}},
              {3, 2, {{70.3, s, 8.0}, {70.3 + 1.1 * width, s, 3.0}, {70.3 + 2.4 * width, s, 6.0}}},
              {3, 3, {{70.3, s, 8.0}, {70.3 + 2.0 * width, s, 3.0}, {70.3 + 4.0 * width, s, 6.0}}}};
    for (size_t i = 0; i < sizeof is / sizeof is[0]; i++) {
        const struct finder_run run = window(NULL);
        struct finder_peak peak[FINDER_PEAKS];
        struct finder_mix mix;
        set_sum(is[i].g, is[i].n);
        const uint32_t n = finder_peaks(&run, 0.5, peak, FINDER_PEAKS);
        if (n != is[i].peaks) fail_msg("case %zu: %u maxima", i, n);
        finder_decompose(&run, peak, n, 1, &mix);
        if (mix.n != is[i].n) fail_msg("case %zu: %u terms", i, mix.n);
        expect_terms(&mix, is[i].g, is[i].n, 0.02);
        assert_int_equal(mix.open, 0);
        assert_int_equal(mix.limited, 0);
        finder_decompose(&run, peak, n, 0, &mix); /* none is added */
        assert_int_equal(mix.n, n);
    }
}

/* Two pulses whose maxima are one are found by their moments, which are exact where there is no noise. The steps that
 * follow have nothing to do. */
static void two_pulses_are_told_by_their_moments(void **state)
{
    (void)state;
    static const double peaks[][2] = {{6.0, 6.0}, {6.0, 4.0}, {6.0, 1.5}, {1.5, 6.0}, {2.0, 8.0}};
    const double s = finder_rig_of(w)->spread[0].sigma, width = 2.3548 * s;
    for (size_t i = 0; i < sizeof peaks / sizeof peaks[0]; i++)
        for (double apart = 0.5; apart <= 0.75; apart += 0.05) {
            const struct finder_run run = window(NULL);
            const struct finder_term want[2] = {{70.3, s, peaks[i][0]}, {70.3 + apart * width, s, peaks[i][1]}};
            struct finder_peak peak[FINDER_PEAKS];
            struct finder_mix mix;
            set_sum(want, 2);
            assert_int_equal(finder_peaks(&run, 0.5, peak, FINDER_PEAKS), 1);
            finder_decompose(&run, peak, 1, 1, &mix);
            expect_terms(&mix, want, 2, 0.01);
        }
}

/* Noise of a fifth of the threshold: a second pulse of 5 sigma is found beside one of 30, and what has 3.5 sigma is no
 * pulse. The least is 4 sigma. */
static void weak_pulses_in_noise(void **state)
{
    (void)state;
    struct waveform *noisy = finder_rig_open(0.2);
    const double s = finder_rig_of(noisy)->spread[0].sigma, width = 2.3548 * s;
    for (int weak = 0; weak < 2; weak++) {
        const struct finder_run run = {finder_rig_of(noisy), y, N, NULL, 0.0};
        const struct finder_term sum[2] = {{60.3, s, 6.0}, {60.3 + 1.2 * width, s, weak ? 0.7 : 1.0}};
        struct finder_peak peak[FINDER_PEAKS];
        struct finder_mix mix;
        set_sum(sum, 2);
        const uint32_t n = finder_peaks(&run, 1.0, peak, FINDER_PEAKS);
        assert_int_equal(n, 1);
        finder_decompose(&run, peak, n, 1, &mix);
        if (weak)
            assert_int_equal(mix.n, 1);
        else
            expect_terms(&mix, sum, 2, 0.05);
    }
    waveform_free(noisy);
}

/* A top that is limited is found again by its flanks, and so is one that the window cuts off. */
static void tops_that_are_not_seen(void **state)
{
    (void)state;
    const double s = finder_rig_of(w)->spread[0].sigma, limit = finder_rig_of(w)->limit;
    for (double peak_of = 12.0; peak_of < 40.0; peak_of *= 1.4) {
        const struct finder_term want = {70.3, s, peak_of};
        uint8_t mark[N] = {0};
        const struct finder_run run = window(mark);
        struct finder_peak peak[4];
        struct finder_mix mix;
        set_sum(&want, 1);
        for (int i = 0; i < N; i++)
            if (y[i] > limit) {
                y[i] = 10.0;
                mark[i] = FINDER_LIMITED;
            }
        assert_int_equal(finder_peaks(&run, 0.5, peak, 4), 1);
        finder_decompose(&run, peak, 1, 0, &mix);
        assert_true(mix.limited == 1 && mix.open == 1);
        expect_terms(&mix, &want, 1, 0.02);
    }
    const struct finder_term cut = {0.0, s, 6.0};
    const struct finder_run run = window(NULL);
    struct finder_peak peak[4];
    struct finder_mix mix;
    set_sum(&cut, 1);
    assert_int_equal(finder_peaks(&run, 0.5, peak, 4), 1);
    finder_decompose(&run, peak, 1, 0, &mix);
    assert_true(mix.limited == 0 && mix.open == 1);
    expect_terms(&mix, &cut, 1, 0.02);
}

/* After the first limited sample nothing is seen any more. The last two samples before it give the place and the height
 * of the pulse, since a Gaussian of that width goes through both in one way only. Here both are well above the
 * noise. */
static void a_flank_gives_the_whole_pulse(void **state)
{
    (void)state;
    const double s = finder_rig_of(w)->spread[0].sigma, limit = finder_rig_of(w)->limit;
    for (double peak_of = 12.0; peak_of < 200.0; peak_of *= 1.3) {
        const struct finder_term want = {70.3, s, peak_of};
        uint8_t mark[N] = {0};
        const struct finder_run run = window(mark);
        struct finder_peak peak[4];
        struct finder_mix mix;
        int first = 0;
        set_sum(&want, 1);
        while (y[first] <= limit)
            first++;
        y[first] = 10.0;
        mark[first] = FINDER_LIMITED;
        for (int i = first + 1; i < N; i++) {
            y[i] = 0.0;
            mark[i] = i < first + 20 ? FINDER_BLIND : 0;
        }
        assert_int_equal(finder_peaks(&run, 0.5, peak, 4), 1);
        finder_decompose(&run, peak, 1, 0, &mix);
        assert_true(mix.limited == 1 && mix.open == 1);
        expect_terms(&mix, &want, 1, 0.01);
    }
}

/* This signal rises from nothing to the limit within a sample, more steeply than any pulse. The height is then e^9
 * times the limit: more than 39 dB above it is not believed. */
static void a_height_is_believed_up_to_39_db(void **state)
{
    (void)state;
    uint8_t mark[N] = {0};
    const struct finder_run run = window(mark);
    struct finder_peak peak[4];
    struct finder_mix mix;
    memset(y, 0, sizeof y);
    y[70] = finder_rig_of(w)->limit;
    mark[70] = FINDER_LIMITED;
    memset(mark + 71, FINDER_BLIND, 20);
    assert_int_equal(finder_peaks(&run, 0.5, peak, 4), 1);
    finder_decompose(&run, peak, 1, 0, &mix);
    assert_true(mix.n == 1 && fabs(mix.g[0].peak / y[70] / exp(9.0) - 1.0) < 1e-3);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(a_sum_is_fitted),
                                       cmocka_unit_test(a_wide_term_costs),
                                       cmocka_unit_test(sums_are_taken_apart),
                                       cmocka_unit_test(two_pulses_are_told_by_their_moments),
                                       cmocka_unit_test(weak_pulses_in_noise),
                                       cmocka_unit_test(tops_that_are_not_seen),
                                       cmocka_unit_test(a_flank_gives_the_whole_pulse),
                                       cmocka_unit_test(a_height_is_believed_up_to_39_db)};
    return cmocka_run_group_tests(tests, open_pulse, close_pulse);
}
