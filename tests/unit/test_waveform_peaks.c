/* SPDX-License-Identifier: MIT */
/* How maxima are found in a window, and measured (core/waveform/detect_inside.h), on samples of Gaussians. */
#include <math.h>
#include <string.h>

#include "tests/unit/finder_rig.h"

enum { N = 64 };

static struct waveform *w;
static double y[N];

/* A pulse of 4 samples, sigma 1.7, with noise of 0.02 thresholds. */
static int open_pulse(void **state)
{
    (void)state;
    w = finder_rig_open(0.02);
    return 0;
}

static int close_pulse(void **state)
{
    (void)state;
    waveform_free(w);
    return 0;
}

static void add(double at, double sigma, double peak)
{
    for (int i = 0; i < N; i++)
        y[i] += peak * exp(-0.5 * pow((i - at) / sigma, 2.0));
}

static struct finder_run window(uint32_t n)
{
    return (struct finder_run){finder_rig_of(w), y, n, NULL, 0.0};
}

/* The parabola through three logarithms is a Gaussian's own. */
static void the_top_of_a_gaussian(void **state)
{
    (void)state;
    const struct finder_run run = window(N);
    double place;
    for (double at = 19.55; at < 20.5; at += 0.1) {
        memset(y, 0, sizeof y);
        add(at, 1.3, 5.0);
        assert_true(fabs(finder_top(&run, 20, &place) - 5.0) < 1e-9);
        assert_true(fabs(place - at) < 1e-9);
    }
    /* A neighbour of zero or less counts as 2 % of the top. With logarithms a and b of its neighbours over the top, the
     * parabola's top lies (a - b) / (2 (a + b)) after it. */
    for (int k = 0; k < 2; k++) {
        const double a = log(0.02), b = log(0.5);
        memset(y, 0, sizeof y);
        y[19] = k ? -1.0 : 1.0;
        y[20] = 2.0;
        y[21] = k ? 1.0 : -1.0;
        const double top = finder_top(&run, 20, &place), off = (k ? 1.0 : -1.0) * (a - b) / (2.0 * (a + b));
        assert_true(fabs(place - 20.0 - off) < 1e-12);
        assert_true(fabs(top - 2.0 * exp(-0.125 * (b - a) * (b - a) / (a + b))) < 1e-12);
    }
    /* No parabola where a neighbour is above, where all are the same, and at the ends. */
    static const double flat[3][3] = {{3.0, 2.0, 1.0}, {1.0, 2.0, 3.0}, {2.0, 2.0, 2.0}};
    for (int k = 0; k < 3; k++) {
        memcpy(y + 19, flat[k], sizeof flat[k]);
        assert_true(finder_top(&run, 20, &place) == 2.0 && place == 20.0);
    }
    y[0] = y[1] = y[N - 1] = y[N - 2] = 1.5;
    assert_true(finder_top(&run, 0, &place) == 1.5 && place == 0.0);
    assert_true(finder_top(&run, N - 1, &place) == 1.5 && place == N - 1);
}

/* Half maxima of a Gaussian are 1.1774 sigmas from its middle. A straight line between two samples has an error of 0.08
 * / sigma; its bend is taken into account. If one side is not seen, the other one is mirrored. The width may then
 * count half, and the bend up to four times. If neither is seen, the ends of the peak are taken. */
static void half_maxima(void **state)
{
    (void)state;
    const struct finder_run run = window(N);
    const double half = sqrt(2.0 * M_LN2);
    double side[2];
    for (double sigma = 1.5; sigma < 6.0; sigma += 0.7)
        for (double at = 29.5; at < 30.5; at += 0.17) {
            const uint32_t top = (uint32_t)lround(at);
            const double most = 0.03, more = 0.1;
            memset(y, 0, sizeof y);
            add(at, sigma, 7.0);
            const struct finder_peak all = {top, 0, N}, right = {top, top - 1, N}, left = {top, 0, top + 2};
            assert_int_equal(finder_half(&run, &all, 7.0, side), 2);
            assert_true(fabs(side[0] - (at - half * sigma)) < most && fabs(side[1] - (at + half * sigma)) < most);
            assert_int_equal(finder_half(&run, &right, 7.0, side), 1);
            assert_true(fabs(side[0] - (at - half * sigma)) < more && fabs(side[1] - (at + half * sigma)) < more);
            assert_int_equal(finder_half(&run, &left, 7.0, side), 1);
            assert_true(fabs(side[0] - (at - half * sigma)) < more && fabs(side[1] - (at + half * sigma)) < more);
            const struct finder_peak none = {top, top - 1, top + 2};
            assert_int_equal(finder_half(&run, &none, 7.0, side), 0);
            assert_true(side[0] == top - 1.0 && side[1] == top + 1.0);
        }
    /* A spike rises and falls within a sample: its width counts as half a sample. */
    memset(y, 0, sizeof y);
    y[20] = 1.0;
    assert_int_equal(finder_half(&run, &(struct finder_peak){20, 0, N}, 1.99, side), 2);
    assert_true(fabs(side[1] - side[0] - 0.5) < 0.02 && fabs(side[0] + side[1] - 40.0) < 1e-9);
}

static void expect_peak(const struct finder_peak *peak, uint32_t top, uint32_t from, uint32_t to)
{
    if (peak->top != top || peak->from != from || peak->to != to)
        fail_msg("%u from %u to %u", peak->top, peak->from, peak->to);
}

/* Samples of a maximum reach to the minima beside it, which it shares with its neighbours. */
static void maxima_of_a_window(void **state)
{
    (void)state;
    const struct finder_run run = window(N);
    struct finder_peak peak[4];
    memset(y, 0, sizeof y);
    add(15.0, 2.0, 8.0);
    add(25.0, 2.0, 5.0);
    add(45.0, 2.0, 0.6);
    assert_int_equal(finder_peaks(&run, 0.5, peak, 4), 3);
    uint32_t low = 15;
    for (uint32_t i = 15; i < 25; i++)
        if (y[i] < y[low]) low = i;
    expect_peak(&peak[0], 15, 0, low + 1);
    assert_int_equal(peak[1].top, 25);
    assert_int_equal(peak[1].from, low);
    assert_true(peak[1].to > 30 && peak[1].to == peak[2].from + 1);
    assert_true(peak[2].top == 45 && peak[2].to == N);
    assert_int_equal(finder_peaks(&run, 0.7, peak, 4), 2); /* less than `least` is none */
    /* Peaks without room are counted, and the first ones stay. */
    memset(peak, 0, sizeof peak);
    assert_int_equal(finder_peaks(&run, 0.5, peak, 1), 3);
    assert_int_equal(peak[0].top, 15);
    assert_int_equal(peak[1].top, 0);
    /* A window may begin or end with a maximum. */
    memset(y, 0, sizeof y);
    add(0.0, 2.0, 3.0);
    add(N - 1.0, 2.0, 4.0);
    assert_int_equal(finder_peaks(&run, 0.5, peak, 4), 2);
    assert_true(peak[0].top == 0 && peak[0].from == 0 && peak[1].top == N - 1 && peak[1].to == N);
}

/* A second maximum has to stand out by 15 %, and by 6.5 sigmas of the noise, of the valley before it. */
static void maxima_stand_out(void **state)
{
    (void)state;
    const struct finder_run run = window(N);
    const double sigmas = 6.5 * finder_rig_of(w)->noise;
    struct finder_peak peak[4];
    for (int weak = 0; weak < 2; weak++) {
        const double second = weak ? 0.8 : 8.0, prominence = weak ? sigmas : 0.15 * second;
        for (int more = 0; more < 2; more++) {
            memset(y, 0, sizeof y);
            for (int i = 10; i < 40; i++)
                y[i] = i < 20 ? 20.0 * second / 8.0 : second - prominence * (more ? 1.01 : 0.99);
            y[30] = second;
            assert_int_equal(finder_peaks(&run, 0.1, peak, 4), 1 + more);
        }
    }
    /* After a signal within a sigma of zero, any maximum of `least` is another echo. */
    memset(y, 0, sizeof y);
    add(20.0, 1.5, 8.0);
    y[40] = 0.11;
    assert_int_equal(finder_peaks(&run, 0.1, peak, 4), 2);
    y[40] = 0.09;
    assert_int_equal(finder_peaks(&run, 0.1, peak, 4), 1);
}

/* After a blind start the signal falls: its maximum was not seen. A limited top is one. */
static void maxima_beside_blind_samples(void **state)
{
    (void)state;
    struct finder_run run = window(N);
    struct finder_peak peak[4];
    uint8_t mark[N] = {0};
    run.mark = mark;
    memset(y, 0, sizeof y);
    for (int i = 0; i < N; i++)
        y[i] = i < 6 ? 0.0 : 8.0 * exp(-0.3 * (i - 6));
    memset(mark, FINDER_BLIND, 6);
    assert_int_equal(finder_peaks(&run, 0.5, peak, 4), 0);
    mark[6] = FINDER_LIMITED;
    assert_int_equal(finder_peaks(&run, 0.5, peak, 4), 1);
    assert_true(finder_limited(&run, &peak[0]) && peak[0].top == 6);
    mark[6] = mark[5] = FINDER_PLAIN;
    assert_int_equal(finder_peaks(&run, 0.5, peak, 4), 1);
    assert_false(finder_limited(&run, &peak[0]));
}

/* One term explains the echo of one plane, and says where, how wide and how high it is. One term explains neither two
 * echoes, nor one that is narrower than any pulse, nor one with another further out. */
static void one_term_is_fitted(void **state)
{
    (void)state;
    const struct finder_run run = window(N);
    const double pulse = finder_rig_of(w)->spread[0].sigma;
    struct finder_term g;
    for (double at = 29.5; at < 30.5; at += 0.17)
        for (double wider = 0.8; wider < 2.0; wider += 0.2) {
            const struct finder_peak peak = {(uint32_t)lround(at), 0, N};
            memset(y, 0, sizeof y);
            add(at, wider * pulse, 6.0);
            assert_int_equal(finder_fit(&run, &peak, &g), 1);
            assert_true(fabs(g.at - at) < 1e-3 && fabs(g.sigma - wider * pulse) < 1e-3 && fabs(g.peak - 6.0) < 1e-3);
            assert_true(finder_fit_near(&run, &peak, &g) < 1e-3);
        }
    const struct finder_peak peak = {30, 0, N};
    memset(y, 0, sizeof y);
    add(30.0, 0.7 * pulse, 6.0);
    assert_int_equal(finder_fit(&run, &peak, &g), 0);
    memset(y, 0, sizeof y);
    add(30.0, pulse, 6.0);
    add(30.0 + 1.5 * pulse, pulse, 4.0);
    assert_int_equal(finder_fit(&run, &peak, &g), 0);
    memset(y, 0, sizeof y);
    add(30.0, pulse, 6.0);
    add(30.0 + 4.0 * pulse, pulse, 0.4);
    assert_int_equal(finder_fit(&run, &peak, &g), 0);
    /* There has to be a flank on both sides. */
    assert_int_equal(finder_fit(&run, &(struct finder_peak){30, 30, N}, &g), 0);
}

/* A mean of n squares of noise exceeds the limit once in 30,000 times. For an even n chi-squared exceeds x with the
 * probability exp(-x / 2) times the sum of (x / 2)^k / k!, k below n / 2. The limit's own formula is approximate: half
 * and twice the share are allowed. */
static void a_limit_of_noise(void **state)
{
    (void)state;
    const double noise2 = finder_rig_of(w)->noise * finder_rig_of(w)->noise;
    for (int n = 2; n <= 100; n += 14) {
        const double half = 0.5 * n * finder_noise2(finder_rig_of(w), n) / noise2;
        double term = exp(-half), share = 0.0;
        for (int k = 0; k < n / 2; k++) {
            share += term;
            term *= half / (k + 1.0);
        }
        if (!(share > 0.5 / 30000.0 && share < 2.0 / 30000.0)) fail_msg("%d: once in %g", n, 1.0 / share);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_top_of_a_gaussian),
        cmocka_unit_test(half_maxima),
        cmocka_unit_test(maxima_of_a_window),
        cmocka_unit_test(maxima_stand_out),
        cmocka_unit_test(maxima_beside_blind_samples),
        cmocka_unit_test(one_term_is_fitted),
        cmocka_unit_test(a_limit_of_noise),
    };
    return cmocka_run_group_tests(tests, open_pulse, close_pulse);
}
