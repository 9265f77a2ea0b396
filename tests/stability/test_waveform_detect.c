/* SPDX-License-Identifier: MIT */
/* Plain detectors of echoes break here: at tops that rounding makes flat, where strong and weak echoes cross one level,
 * at pulses that the receiver limits or the window cuts, and where a parabola goes through logarithms of samples
 * that are not positive. */
#include <math.h>
#include <stdio.h>

#include "tests/common/thorough.h"
#include "tests/common/wave_echoes.h"
#include "tests/stability/table.h"

static const double SAMPLE_M = 0.5 * 299792458.0 * 1e-9;

/* Fills y with the signals of the window. Returns how many there are. */
static uint32_t signals(const struct wave_echoes *w, double *y)
{
    const struct waveform_spec *spec = waveform_spec_of(w->waveform);
    const double one = spec->full_scale / ((1 << spec->bits) - 1.0 - spec->baseline_counts);
    for (uint32_t i = 0; i < w->record.window[0].n; i++)
        y[i] = (w->sample[i] - spec->baseline_counts) * one;
    return w->record.window[0].n;
}

static uint32_t largest(const double *y, uint32_t n)
{
    uint32_t top = 0;
    for (uint32_t i = 1; i < n; i++)
        if (y[i] > y[top]) top = i;
    return top;
}

/* ---- naive methods: the place of an echo in samples after the window's first */

static double by_largest_sample(const double *y, uint32_t n)
{
    return largest(y, n);
}

static double by_level(const double *y, uint32_t n)
{
    uint32_t i = 1;
    while (i < n - 1 && y[i] < 1.0)
        i++;
    return i - 1 + (1.0 - y[i - 1]) / (y[i] - y[i - 1]) + 2.0; /* half of the pulse later */
}

static double by_log_parabola(const double *y, uint32_t n)
{
    uint32_t top = largest(y, n);
    if (top == 0 || top + 1 == n) return NAN;
    double a = log(y[top - 1]), b = log(y[top]), c = log(y[top + 1]);
    return top + 0.5 * (a - c) / (a - 2.0 * b + c);
}

/* One Gaussian by Gauss and Newton's steps through all samples as they are, from the largest sample and the pulse's
 * sigma. */
static double by_plain_fit(const double *y, uint32_t n)
{
    double at = largest(y, n), peak = y[largest(y, n)], sigma = wave_sigma(4.0);
    for (int step = 0; step < 30; step++) {
        double m[3][4] = {{0.0}};
        for (uint32_t i = 0; i < n; i++) {
            double d = (i - at) / sigma, g = exp(-0.5 * d * d),
                   v[3] = {g, peak * g * d / sigma, peak * g * d * d / sigma};
            for (int a = 0; a < 3; a++) {
                for (int b = 0; b < 3; b++)
                    m[a][b] += v[a] * v[b];
                m[a][3] += v[a] * (y[i] - peak * g);
            }
        }
        for (int k = 0; k < 3; k++)
            for (int a = 0; a < 3; a++)
                for (int b = 3; a != k && b >= k; b--)
                    m[a][b] -= m[a][k] / m[k][k] * m[k][b];
        peak += m[0][3] / m[0][0];
        at += m[1][3] / m[1][1];
        sigma += m[2][3] / m[2][2];
    }
    return at;
}

/* The largest error of a place, m; one that is no number or not in the window counts as the whole window. */
struct errors {
    double naive_m, ours_m;
};
static void compare(struct wave_echoes *w, double (*naive)(const double *, uint32_t), enum waveform_detector detector,
                    const struct waveform_return *r, uint64_t pulse, struct errors *worst)
{
    double y[WAVEFORM_MAX_SAMPLES], ours_m = INFINITY;
    if (wave_shoot(w, detector, pulse, r, 1) == 1) ours_m = fabs(w->echo[0].range_m - r->range_m);
    const uint32_t n = signals(w, y);
    const double place = naive(y, n), off = fabs((w->record.window[0].first + place) * SAMPLE_M - r->range_m);
    worst->naive_m = fmax(worst->naive_m, place >= 0.0 && place < n ? off : n * SAMPLE_M);
    worst->ours_m = fmax(worst->ours_m, ours_m);
}

/* 8 bits, and an echo of 16 counts: the top is a plateau of equal samples, of which the first is the largest. The
 * threshold is 4 counts. Noise is a quarter of a count, less than the rounding, 1/sqrt(12) of a count. */
static void flat_tops(void **state)
{
    (void)state;
    struct waveform_spec spec = wave_spec();
    struct wave_echoes w;
    struct errors worst = {0.0, 0.0};
    spec.bits = 8;
    spec.baseline_counts = 16.0;
    spec.full_scale = 60.0;
    spec.noise = 0.06;
    wave_open(&w, &spec);
    for (uint64_t p = 0; p < 400; p++) {
        const struct waveform_return r = {40.0 + 0.01 * (double)p * SAMPLE_M, 4.0, 0.0, WAVEFORM_POINT};
        compare(&w, by_largest_sample, WAVEFORM_GAUSSIANS, &r, p, &worst);
    }
    /* 4.75 deviations: 400 echoes exceed that once in 1,000 runs */
    const double count = 60.0 / 239.0, noise = sqrt(0.06 * 0.06 + count * count / 12.0);
    table_row("tops of 16 counts, plateaus of equal samples", "largest sample", worst.naive_m, worst.ours_m,
              4.75 * wave_least_sigma_m(4.0, noise, wave_sigma(4e-9), 1e-9), "m");
    wave_close(&w);
    table_check();
}

/* The same surface is 5 to 20 dB above the level. There is no noise, as the walk is a bias. */
static void walk(void **state)
{
    (void)state;
    struct waveform_spec spec = wave_spec();
    struct wave_echoes w;
    spec.bits = 14;
    spec.full_scale = 120.0;
    spec.noise = 0.0;
    wave_open(&w, &spec);
    for (int db = 5; db <= 20; db += 5) {
        struct errors worst = {0.0, 0.0};
        char regime[64];
        for (uint64_t p = 0; p < 100; p++) {
            const struct waveform_return r = {40.0 + 0.01 * (double)p * SAMPLE_M, pow(10.0, 0.1 * db), 0.0,
                                              WAVEFORM_POINT};
            compare(&w, by_level, WAVEFORM_THRESHOLD, &r, p, &worst);
        }
        snprintf(regime, sizeof regime, "a level 1, an echo %d dB above it", db);
        /* A count is 0.0074 thresholds. The sample before the crossing has at least 0.1 thresholds, and the slope is
         * at least 0.2 a sample. So half a count is 0.02 samples. */
        table_row(regime, "crossing, half a pulse later", worst.naive_m, worst.ours_m, 3e-3, "m");
    }
    wave_close(&w);
    table_check();
}

/* 10 to 30 dB above what the receiver takes. */
static void limited(void **state)
{
    (void)state;
    struct waveform_spec spec = wave_spec();
    struct wave_echoes w;
    wave_open(&w, &spec);
    for (int db = 10; db <= 30; db += 10) {
        struct errors worst = {0.0, 0.0};
        char regime[64];
        for (uint64_t p = 0; p < 200; p++) {
            const struct waveform_return r = {40.0 + 0.005 * (double)p * SAMPLE_M, 100.0 * pow(10.0, 0.1 * db), 0.0,
                                              WAVEFORM_POINT};
            compare(&w, by_plain_fit, WAVEFORM_GAUSSIANS, &r, p, &worst);
        }
        snprintf(regime, sizeof regime, "an echo %d dB above the full scale", db);
        table_row(regime, "one Gaussian through all samples", worst.naive_m, worst.ours_m, 5e-3, "m");
    }
    wave_close(&w);
    table_check();
}

/* Windows of a gate that begin within the echo, up to 2.4 samples after its top. */
static void truncated(void **state)
{
    (void)state;
    struct waveform_spec spec = wave_spec();
    struct errors worst = {0.0, 0.0};
    for (int k = 0; k < 20; k++) {
        struct wave_echoes w;
        spec.near_m = 40.0;
        spec.far_m = 46.0;
        wave_open(&w, &spec);
        const struct waveform_return r = {40.0 + (0.5 - 0.15 * k) * SAMPLE_M, 60.0, 0.0, WAVEFORM_POINT};
        compare(&w, by_plain_fit, WAVEFORM_GAUSSIANS, &r, (uint64_t)k, &worst);
        wave_close(&w);
    }
    table_row("a gate that cuts the echo at its top", "one Gaussian through all samples", worst.naive_m, worst.ours_m,
              0.02, "m");
    table_check();
}

/* A pulse of 1.5 ns at samples of 1 ns, near the level: a neighbour of the top may be zero or less. */
static void logarithms(void **state)
{
    (void)state;
    struct waveform_spec spec = wave_spec();
    struct wave_echoes w;
    struct errors worst = {0.0, 0.0};
    spec.width_s = 1.5e-9;
    wave_open(&w, &spec);
    for (uint64_t p = 0; p < 1000; p++) {
        const struct waveform_return r = {40.0 + 0.01 * (double)p * SAMPLE_M, 1.6, 0.0, WAVEFORM_POINT};
        compare(&w, by_log_parabola, WAVEFORM_GAUSSIANS, &r, p, &worst);
    }
    table_row("a short and weak pulse, samples of 0 and less", "parabola through logarithms", worst.naive_m,
              worst.ours_m, SAMPLE_M, "m");
    wave_close(&w);
    table_check();
}

static int head(void **state)
{
    (void)state;
    table_head("echoes in waveforms");
    return 0;
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(flat_tops), cmocka_unit_test(walk),       cmocka_unit_test(limited),
        cmocka_unit_test(truncated), cmocka_unit_test(logarithms),
    };
    return cmocka_run_group_tests(tests, head, NULL);
}
