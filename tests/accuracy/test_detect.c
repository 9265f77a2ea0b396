/* SPDX-License-Identifier: MIT */
/* Detection over many pulses. The noise has the sigma that follows from the data sheet's figures, is normal, and is
 * independent of everything else. Targets vanish where the data sheet says. Seeds are fixed. If a statistic of n
 * numbers is compared, 4.75 of its standard errors are allowed, which chance exceeds twice in a million. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "tests/common/cases.h"

#include "core/detect.h"
#include "core/line.h"
#include "core/rng.h"

enum { MANY = 1000000 };
static const double ERRORS = 4.75;

struct pulses {
    uint64_t key[MANY];
    double range_m[MANY], rho[MANY], amplitude[MANY];
    int16_t refl_cdb[MANY];
};
static struct pulses *pulses;

static int make_pulses(void **state)
{
    (void)state;
    pulses = malloc(sizeof *pulses);
    return pulses == NULL ? -1 : 0;
}

static int free_pulses(void **state)
{
    (void)state;
    free(pulses);
    return 0;
}

/* A head as its data sheet describes it. */
static struct detect_signal_spec head(void)
{
    return (struct detect_signal_spec){.n_reaches = 2,
                                       .reach = {{0.9, 800.0}, {0.2, 400.0}},
                                       .threshold_snr = 8.0,
                                       .sigma_m = 0.003,
                                       .sigma_at_m = 100.0,
                                       .sigma_reflectance = 0.9,
                                       .sigma_floor_m = 0.002,
                                       .seed = 1};
}

static void set_up(const struct detect_signal_spec *spec, struct detect_signal *signal)
{
    struct sh_err err;
    if (detect_signal_set_up(spec, signal, &err) != SH_OK) fail_msg("%s", err.text);
}

/* Detects n pulses from pulse0 on at a target, and keeps echo `number` of each. */
static struct detect_echoes shoot(uint32_t n, uint64_t pulse0, uint32_t number, double range_m, double rho)
{
    for (uint32_t i = 0; i < n; i++) {
        pulses->key[i] = rng_echo(pulse0 + i, number);
        pulses->range_m[i] = range_m;
        pulses->rho[i] = rho;
    }
    return (struct detect_echoes){.n = n,
                                  .key = pulses->key,
                                  .range_m = pulses->range_m,
                                  .rho = pulses->rho,
                                  .amplitude = pulses->amplitude,
                                  .refl_cdb = pulses->refl_cdb};
}

/* The two ranges of `head` give the extinction of the data sheet's air. rho_min grows as R^2 exp(2 a R), so 2 a 400 m
 * = log(0.9 / 0.2) - 2 log 2. The figure at 100 m then holds at R by the ratio of the signals. */
static double sigma_of(double range_m, double rho)
{
    double a2 = (log(0.9 / 0.2) - 2.0 * log(2.0)) / 400.0;
    double weaker = 0.9 / rho * pow(range_m / 100.0, 2.0) * exp(a2 * (range_m - 100.0));
    return sqrt(2e-3 * 2e-3 + (3e-3 * 3e-3 - 2e-3 * 2e-3) * weaker * weaker);
}

static void sigma_follows_range_and_reflectance(void **state)
{
    (void)state;
    static const double range_m[] = {10.0, 50.0, 100.0, 200.0, 300.0}, rho[] = {0.2, 0.5, 0.9};
    struct detect_signal_spec spec = head();
    struct detect_signal signal;
    set_up(&spec, &signal);
    double worst = 0.0;
    for (int r = 0; r < 5; r++)
        for (int p = 0; p < 3; p++) {
            double sum = 0.0, sum2 = 0.0, sigma = sigma_of(range_m[r], rho[p]);
            struct detect_echoes echoes = shoot(MANY, 10 * MANY * (uint64_t)(3 * r + p), 0, range_m[r], rho[p]);
            detect_by_signal(&signal, &echoes);
            detect_range_noise(&signal, &echoes);
            for (uint32_t i = 0; i < MANY; i++) {
                double off = pulses->range_m[i] - range_m[r]; /* no pulse is lost here: NaN would show */
                sum += off;
                sum2 += off * off;
            }
            double mean = sum / MANY, sd = sqrt(sum2 / MANY - mean * mean);
            print_message("%5g m, reflectance %g: sigma %.4f mm, measured %.4f mm\n", range_m[r], rho[p], 1e3 * sigma,
                          1e3 * sd);
            assert_true(fabs(mean) < ERRORS * sigma / sqrt(MANY));
            assert_true(fabs(sd / sigma - 1.0) < ERRORS / sqrt(2.0 * MANY));
            worst = fmax(worst, fabs(sd / sigma - 1.0));
        }
    print_message("sigma is off by at most %.3f %%; allowed 2 %%\n", 100.0 * worst);
    assert_true(worst < 0.02);
    assert_true(fabs(sigma_of(100.0, 0.9) - 0.003) < 1e-15); /* the data sheet's own figure */
}

static double normal_below(double z)
{
    return 0.5 * erfc(-z / sqrt(2.0));
}

static int by_size(const void *a, const void *b)
{
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

/* Anderson and Darling's A^2 against the standard normal distribution, with nothing estimated, is above 6.0 once in
 * 1000 (T. W. Anderson, D. A. Darling, A test of goodness of fit, 1954). The test has chi^2 of 1000 equally likely
 * bins, too: 999 +- 44.7. */
static void check_normal(double *z, uint32_t n)
{
    static uint32_t bin[1000];
    double a2 = 0.0, chi2 = 0.0;
    memset(bin, 0, sizeof bin);
    qsort(z, n, sizeof *z, by_size);
    for (uint32_t i = 0; i < n; i++) {
        double p = normal_below(z[i]), q = normal_below(-z[n - 1 - i]);
        a2 -= (2.0 * i + 1.0) / n * (log(p) + log(q));
        bin[(uint32_t)(p * 1000.0)]++;
    }
    a2 -= n;
    for (int b = 0; b < 1000; b++)
        chi2 += pow(bin[b] - n / 1000.0, 2.0) / (n / 1000.0);
    print_message("A^2 %.3f, chi^2 of 999 %.1f\n", a2, chi2);
    assert_true(a2 < 6.0);
    assert_true(fabs(chi2 - 999.0) < ERRORS * sqrt(2.0 * 999.0));
}

static void range_noise_is_normal(void **state)
{
    (void)state;
    struct detect_signal_spec spec = head();
    struct detect_signal signal;
    set_up(&spec, &signal);
    struct detect_echoes echoes = shoot(MANY, 0, 0, 150.0, 0.4);
    detect_by_signal(&signal, &echoes);
    detect_range_noise(&signal, &echoes);
    for (uint32_t i = 0; i < MANY; i++)
        pulses->range_m[i] = (pulses->range_m[i] - 150.0) / sigma_of(150.0, 0.4);
    check_normal(pulses->range_m, MANY);
}

static void fill_normal(double *z, uint64_t seed, enum rng_purpose purpose, uint32_t number)
{
    uint64_t key = rng_key(seed, purpose);
    for (uint32_t i = 0; i < MANY; i++)
        z[i] = rng_normal(key, rng_echo(i, number));
}

static double correlation(const double *x, const double *y, uint32_t n)
{
    double sum = 0.0;
    for (uint32_t i = 0; i < n; i++)
        sum += x[i] * y[i];
    return sum / n;
}

/* There is no correlation between pulses at 13 distances, echoes of a pulse, purposes and seeds, neither of the numbers
 * nor of their squares. */
static void noise_hangs_on_nothing(void **state)
{
    (void)state;
    static const uint32_t lag[] = {1, 2, 3, 4, 7, 8, 15, 16, 17, 64, 1000, 1024, 65536};
    double *z[7];
    for (int i = 0; i < 7; i++)
        assert_non_null(z[i] = malloc(MANY * sizeof(double)));
    fill_normal(z[0], 1, RNG_RANGE, 0);
    fill_normal(z[1], 1, RNG_RANGE, 1);
    fill_normal(z[2], 1, RNG_RANGE, 14);
    fill_normal(z[3], 1, RNG_SIGNAL, 0);
    fill_normal(z[4], 1, RNG_MIRROR, 0);
    fill_normal(z[5], 1, RNG_PAN, 0);
    fill_normal(z[6], 2, RNG_RANGE, 0);
    for (int square = 0; square < 2; square++) {
        for (size_t k = 0; k < sizeof lag / sizeof *lag; k++) {
            uint32_t n = MANY - lag[k];
            assert_true(fabs(correlation(z[0], z[0] + lag[k], n)) < ERRORS / sqrt(n));
        }
        for (int i = 0; i < 7; i++)
            for (int k = 0; k < i; k++)
                assert_true(fabs(correlation(z[i], z[k], MANY)) < ERRORS / sqrt(MANY));
        for (int i = 0; i < 7; i++)
            for (uint32_t p = 0; p < MANY; p++)
                z[i][p] = (z[i][p] * z[i][p] - 1.0) / sqrt(2.0); /* mean 0, variance 1 again */
    }
    for (int i = 0; i < 7; i++)
        free(z[i]);
}

static double share_seen(const struct detect_signal *signal, uint32_t n, uint64_t pulse0, double range_m, double rho)
{
    uint32_t seen = 0;
    struct detect_echoes echoes = shoot(n, pulse0, 0, range_m, rho);
    detect_by_signal(signal, &echoes);
    for (uint32_t i = 0; i < n; i++) {
        assert_int_equal(isnan(pulses->range_m[i]) != 0, pulses->refl_cdb[i] == LINE_REFL_NONE);
        seen += pulses->range_m[i] == range_m;
    }
    return (double)seen / n;
}

/* Bisection finds the range where half of the pulses still see a target: the data sheet's, to 2 %. */
static void targets_vanish_where_the_data_sheet_says(void **state)
{
    (void)state;
    enum { N = 20000 };
    struct detect_signal_spec spec = head();
    struct detect_signal signal;
    spec.n_reaches = 3;
    spec.reach[0] = (struct detect_reach){0.2, 400.0}; /* in any order */
    spec.reach[1] = (struct detect_reach){0.9, 800.0};
    spec.reach[2] = (struct detect_reach){0.05, 210.0};
    set_up(&spec, &signal);
    for (int k = 0; k < 3; k++) {
        double lo = 0.8 * spec.reach[k].range_m, hi = 1.2 * spec.reach[k].range_m;
        for (int step = 0; step < 20; step++) {
            double mid = 0.5 * (lo + hi);
            if (share_seen(&signal, N, (uint64_t)step * N, mid, spec.reach[k].reflectance) > 0.5)
                lo = mid;
            else
                hi = mid;
        }
        print_message("a target of %g vanishes at %.2f m; data sheet %g m\n", spec.reach[k].reflectance, lo,
                      spec.reach[k].range_m);
        assert_true(fabs(lo / spec.reach[k].range_m - 1.0) < 0.02);
    }
}

/* The expected share is Phi(k (A - 1)). If the data sheet gives one range R_k, A = (R_k / R)^2. */
static void the_share_seen_is_the_detection_probability(void **state)
{
    (void)state;
    static const double amplitude[] = {0.7, 0.85, 0.95, 1.0, 1.1, 1.2, 1.35};
    struct detect_signal_spec spec = head();
    struct detect_signal signal;
    spec.n_reaches = 1;
    set_up(&spec, &signal);
    for (size_t i = 0; i < sizeof amplitude / sizeof *amplitude; i++) {
        double p = normal_below(8.0 * (amplitude[i] - 1.0));
        double seen = share_seen(&signal, MANY, i * MANY, 800.0 / sqrt(amplitude[i]), 0.9);
        assert_true(fabs(seen - p) < ERRORS * sqrt(p * (1.0 - p) / MANY));
    }
    spec.sharp = 1;
    set_up(&spec, &signal);
    assert_true(share_seen(&signal, 100, 0, 799.999, 0.9) == 1.0 && share_seen(&signal, 100, 0, 800.001, 0.9) == 0.0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(sigma_follows_range_and_reflectance),
        cmocka_unit_test(range_noise_is_normal),
        cmocka_unit_test(noise_hangs_on_nothing),
        cmocka_unit_test(targets_vanish_where_the_data_sheet_says),
        cmocka_unit_test(the_share_seen_is_the_detection_probability),
    };
    return cmocka_run_group_tests(tests, make_pulses, free_pulses);
}
