/* SPDX-License-Identifier: MIT */
/* These are tests of the random generator. All seeds are fixed, so a run can't fail by chance. The limits are chosen as
 * for random seeds: each check would fail for one good generator in 10^5 or fewer (about 140 checks, so together for
 * one in 700). */
#include "tests/common/cases.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/rng.h"

enum { N = 1000000 };
static const double Z_LIMIT = 4.75; /* two-sided: 2.0e-6 */

static double *normals(uint64_t key)
{
    double *x = malloc(N * sizeof *x);
    assert_non_null(x);
    for (uint64_t i = 0; i < N; i++)
        x[i] = rng_normal(key, i);
    return x;
}

/* These are outputs of SplitMix64 for the seed 1234567, as published with the algorithm. */
static void the_finaliser_is_that_of_splitmix64(void **state)
{
    (void)state;
    static const uint64_t expected[] = {6457827717110365317ULL, 3203168211198807973ULL, 9817491932198370423ULL,
                                        4593380528125082431ULL, 16408922859458223821ULL};
    for (uint64_t i = 0; i < 5; i++)
        assert_true(rng_mix(1234567 + (i + 1) * 0x9e3779b97f4a7c15ULL) == expected[i]);
}

static void a_number_depends_on_seed_purpose_and_pulse_only(void **state)
{
    (void)state;
    uint64_t key = rng_key(7, RNG_RANGE);
    uint64_t first = rng_u64(key, 1000);
    for (uint64_t i = 0; i < 100; i++)
        rng_normal(key, i);
    assert_true(rng_u64(rng_key(7, RNG_RANGE), 1000) == first);
    assert_true(rng_u64(key, 1001) != first);
    assert_true(rng_u64(rng_key(8, RNG_RANGE), 1000) != first);
    assert_true(rng_u64(rng_key(7, (enum rng_purpose)2), 1000) != first);
    assert_true(rng_u64(rng_key(7 + (UINT64_C(1) << 32), RNG_RANGE), 1000) != first);
}

/* Two purposes with one key would draw the same numbers. */
static void no_two_purposes_are_one(void **state)
{
    (void)state;
    static const enum rng_purpose purpose[] = {
        RNG_RANGE,       RNG_SCENE, RNG_GNSS, RNG_SIGNAL,   RNG_MIRROR, RNG_PAN,  RNG_BALL,
        RNG_BALL_RADIUS, RNG_FAULT, RNG_PTP,  RNG_WAVEFORM, RNG_SPARSE, RNG_PLAN,
    };
    for (size_t i = 0; i < sizeof purpose / sizeof purpose[0]; i++)
        for (size_t k = 0; k < i; k++)
            assert_true(rng_key(7, purpose[i]) != rng_key(7, purpose[k]));
}

/* Standard errors of a normal sample: 1/sqrt(n), sqrt(2/n), sqrt(6/n), sqrt(24/n). */
static void moments_are_those_of_a_normal(void **state)
{
    (void)state;
    double *x = normals(rng_key(1, RNG_RANGE)), mean = 0.0, m2 = 0.0, m3 = 0.0, m4 = 0.0;
    for (int i = 0; i < N; i++)
        mean += x[i] / N;
    for (int i = 0; i < N; i++) {
        double d = x[i] - mean;
        m2 += d * d / N;
        m3 += d * d * d / N;
        m4 += d * d * d * d / N;
    }
    free(x);
    double z[] = {mean * sqrt(N), (m2 - 1.0) / sqrt(2.0 / N), m3 / pow(m2, 1.5) / sqrt(6.0 / N),
                  (m4 / (m2 * m2) - 3.0) / sqrt(24.0 / N)};
    print_message("# mean, variance, skewness, kurtosis: %.2f %.2f %.2f %.2f standard errors off\n", z[0], z[1], z[2],
                  z[3]);
    for (int i = 0; i < 4; i++)
        assert_true(fabs(z[i]) < Z_LIMIT);
}

static void neighbours_are_uncorrelated(void **state)
{
    (void)state;
    double *x = normals(rng_key(2, RNG_RANGE));
    for (int lag = 1; lag <= 16; lag++) {
        double r = 0.0;
        for (int i = 0; i + lag < N; i++)
            r += x[i] * x[i + lag];
        double z = r / sqrt(N - lag);
        if (!(fabs(z) < Z_LIMIT)) fail_msg("lag %d: %.2f standard errors", lag, z);
    }
    free(x);
}

static void streams_are_uncorrelated(void **state)
{
    (void)state;
    double *x = normals(rng_key(3, RNG_RANGE));
    uint64_t other[] = {rng_key(3, (enum rng_purpose)2), rng_key(4, RNG_RANGE),
                        rng_key(3 ^ (UINT64_C(1) << 63), RNG_RANGE)};
    for (size_t j = 0; j < 3; j++) {
        double *y = normals(other[j]);
        for (int lag = -8; lag <= 8; lag++) {
            double r = 0.0;
            for (int i = 8; i < N - 8; i++)
                r += x[i] * y[i + lag];
            double z = r / sqrt(N - 16);
            if (!(fabs(z) < Z_LIMIT)) fail_msg("stream %zu, lag %d: %.2f standard errors", j, lag, z);
        }
        free(y);
    }
    free(x);
}

static int ascending(const void *a, const void *b)
{
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

/* Kolmogorov and Smirnov: P(sqrt(n) D > 2.5) = 2 exp(-2 * 2.5^2) = 7.5e-6. Steps of 2^-32 in the uniform numbers are
 * far below 1/sqrt(n). */
static void the_distribution_is_normal(void **state)
{
    (void)state;
    double *x = normals(rng_key(5, RNG_RANGE)), d = 0.0;
    qsort(x, N, sizeof *x, ascending);
    for (int i = 0; i < N; i++) {
        double p = 0.5 * erfc(-x[i] / sqrt(2.0));
        d = fmax(d, fmax(p - (double)i / N, (double)(i + 1) / N - p));
    }
    print_message("# Kolmogorov-Smirnov: sqrt(n) D = %.3f\n", d * sqrt(N));
    assert_true(d * sqrt(N) < 2.5);
    /* 63.3 are expected beyond 4 sigma. A Poisson number below 30 or above 105 has a chance of 3e-6 or less each. */
    int beyond = 0;
    for (int i = 0; i < N; i++)
        beyond += fabs(x[i]) > 4.0;
    assert_in_range(beyond, 30, 105);
    free(x);
}

/* The largest value is -2 log(2^-33): the smallest uniform number is half a step of 2^-32. */
static void nothing_lies_beyond_the_largest(void **state)
{
    (void)state;
    double most = sqrt(66.0 * log(2.0));
    assert_true(most < 6.77);
    uint64_t key = rng_key(6, RNG_RANGE);
    for (uint64_t i = 0; i < N; i++) {
        double x = rng_normal(key, i << 20);
        assert_true(fabs(x) <= most);
    }
}

/* Box and Muller's formula in long double, whose mantissa is 2048 times finer. */
static double error_of(uint64_t bits)
{
    const long double h = ((long double)(bits >> 32) + 0.5L) * 0x1p-32L,
                      a = (long double)(bits & 0xffffffffU) * 0x1p-32L;
    /* log1p: near 1 the logarithm goes through 0. cos(2 pi a) as a sine: likewise at quarters of a turn. */
    const long double radius = sqrtl(-2.0L * (h > 0.5L ? log1pl(h - 1.0L) : logl(h)));
    const long double two_pi = 6.283185307179586476925286766559L;
    return fabs((double)((long double)rng_normal_of(bits) - radius * sinl(two_pi * (fabsl(a - 0.5L) - 0.25L))));
}

/* The tail is included: all radii down to the smallest and up to the largest, at angles all around. */
static void the_arithmetic_is_good_to_4e_12(void **state)
{
    (void)state;
    const uint64_t key = rng_key(11, RNG_RANGE);
    double worst = 0.0;
    for (uint64_t i = 0; i < N; i++)
        worst = fmax(worst, error_of(rng_u64(key, i)));
    for (uint64_t power = 0; power < 32; power++)
        for (uint64_t beside = 0; beside < 2000; beside++) {
            const uint64_t h = (UINT64_C(1) << power) + beside - 1000, l = rng_u64(key, beside);
            worst = fmax(worst, error_of(h << 32 | (l & 0xffffffffU)));
            worst = fmax(worst, error_of(~h << 32 | (l & 0xffffffffU)));
            worst = fmax(worst, error_of(l << 32 | (h & 0xffffffffU)));
        }
    print_message("# worst error %.3g of a standard deviation\n", worst);
    assert_true(worst < 4e-12);
}

/* Blocks give the same as single pulses. */
static void a_block_is_its_pulses(void **state)
{
    (void)state;
    uint64_t pulse[RNG_BLOCK + 5], bits[RNG_BLOCK], key = rng_key(12, RNG_RANGE);
    for (uint64_t i = 0; i < RNG_BLOCK + 5; i++)
        pulse[i] = i * 77;
    assert_int_equal(rng_bits(key, pulse, RNG_BLOCK + 5, bits), RNG_BLOCK);
    for (uint64_t i = 0; i < RNG_BLOCK; i++)
        assert_true(rng_normal_of(bits[i]) == rng_normal(key, pulse[i]));
    assert_int_equal(rng_bits(key, pulse + RNG_BLOCK, 5, bits), 5);
    assert_true(bits[4] == rng_u64(key, pulse[RNG_BLOCK + 4]));
}

/* Computes the quantile of chi-square by Wilson and Hilferty, good to 1 % in the tail from 64 degrees of freedom on. */
static double chi2_limit(double dof, double z)
{
    double c = 1.0 - 2.0 / (9.0 * dof) + z * sqrt(2.0 / (9.0 * dof));
    return dof * c * c * c;
}

static void check_chi2(const char *what, int which, double chi2, double dof)
{
    if (!(chi2 > chi2_limit(dof, -Z_LIMIT) && chi2 < chi2_limit(dof, Z_LIMIT)))
        fail_msg("%s %d: chi-square %.1f with %.0f degrees of freedom", what, which, chi2, dof);
}

static void bits_are_even(void **state)
{
    (void)state;
    static int ones[64], flips[64];
    uint64_t key = rng_key(9, RNG_RANGE), before = rng_u64(key, UINT64_MAX);
    for (uint64_t i = 0; i < N; i++) {
        uint64_t x = rng_u64(key, i);
        for (int b = 0; b < 64; b++) {
            ones[b] += (int)(x >> b & 1);
            flips[b] += (int)((x ^ before) >> b & 1);
        }
        before = x;
    }
    double chi_ones = 0.0, chi_flips = 0.0;
    for (int b = 0; b < 64; b++) {
        chi_ones += pow((ones[b] - N / 2.0) / sqrt(N / 4.0), 2);
        chi_flips += pow((flips[b] - N / 2.0) / sqrt(N / 4.0), 2);
    }
    check_chi2("bits", 0, chi_ones, 64);
    check_chi2("bits that change from pulse to pulse", 0, chi_flips, 64);
}

/* Pulse numbers come one after the other, and with the strides of blocks and lines. */
static void bytes_are_even(void **state)
{
    (void)state;
    static const uint64_t stride[] = {1, 16, 5000, UINT64_C(1) << 32};
    uint64_t key = rng_key(10, RNG_RANGE);
    for (size_t s = 0; s < sizeof stride / sizeof *stride; s++) {
        static int count[8][256];
        memset(count, 0, sizeof count);
        for (uint64_t i = 0; i < N; i++) {
            uint64_t x = rng_u64(key, i * stride[s]);
            for (int b = 0; b < 8; b++)
                count[b][x >> 8 * b & 255]++;
        }
        for (int b = 0; b < 8; b++) {
            double chi2 = 0.0, mean = N / 256.0;
            for (int v = 0; v < 256; v++)
                chi2 += (count[b][v] - mean) * (count[b][v] - mean) / mean;
            check_chi2("byte", b, chi2, 255);
        }
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_finaliser_is_that_of_splitmix64),
        cmocka_unit_test(a_number_depends_on_seed_purpose_and_pulse_only),
        cmocka_unit_test(no_two_purposes_are_one),
        cmocka_unit_test(moments_are_those_of_a_normal),
        cmocka_unit_test(neighbours_are_uncorrelated),
#ifndef SH_SANITIZE /* each draws a million numbers by code that other tests run, so only as shipped */
        cmocka_unit_test(streams_are_uncorrelated),
        cmocka_unit_test(the_distribution_is_normal),
#endif
        cmocka_unit_test(nothing_lies_beyond_the_largest),
        cmocka_unit_test(the_arithmetic_is_good_to_4e_12),
        cmocka_unit_test(a_block_is_its_pulses),
#ifndef SH_SANITIZE
        cmocka_unit_test(bits_are_even),
        cmocka_unit_test(bytes_are_even),
#endif
    };
    return cmocka_run_group_tests_name("rng", tests, NULL, NULL);
}
