/* SPDX-License-Identifier: MIT */
/* Percentiles and counts of known latenesses. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

#include "firmware_sim/loop/lateness.h"
#include "tests/common/cases.h"

static struct lateness lateness;

static int begin(void **state)
{
    (void)state;
    memset(&lateness, 0, sizeof lateness);
    return 0;
}

/* A percentile is the end of the bin that holds the exact one, and a bin is at most 1/32 of its beginning wide. A
 * result in microseconds is a rounded quotient, hence the one part in 1e15. */
static void expect_us(double q, int64_t exact_ns)
{
    const double us = lateness_us(&lateness, q), exact_us = (double)exact_ns / 1e3;
    if (us < exact_us * (1 - 1e-15) || us > exact_us * (1 + 1.0 / 32) * (1 + 1e-15))
        fail_msg("share %g: %.6f us instead of %.6f", q, us, exact_us);
}

static void none_is_late_by_nothing(void **state)
{
    (void)state;
    assert_true(lateness_us(&lateness, 0.99) == 0.0 && lateness_us(&lateness, 1.0) == 0.0);
    assert_int_equal(lateness_count(&lateness), 0);
}

static void percentiles_of_a_ramp(void **state)
{
    (void)state;
    for (int64_t us = 1000; us >= 1; us--)
        lateness_note(&lateness, us * 1000);
    expect_us(0.5, 500000);
    expect_us(0.99, 990000);
    expect_us(0.999, 999000);
    assert_true(lateness_us(&lateness, 1.0) == 1000.0);
    assert_true(lateness_us(&lateness, 0.001) < 1.04); /* the first alone */
}

/* 99 are in time and one is late by a second. The median and p99 don't show it, but a slightly larger share does. */
static void one_in_a_hundred(void **state)
{
    (void)state;
    for (int i = 0; i < 99; i++)
        lateness_note(&lateness, i % 2 == 0 ? 0 : -5000); /* early is not late */
    lateness_note(&lateness, 1000000000);
    assert_true(lateness_us(&lateness, 0.5) == 0.0 && lateness_us(&lateness, 0.99) == 0.0);
    assert_true(lateness_us(&lateness, 0.991) == 1e6); /* no more than the latest */
}

static int by_size(const void *a, const void *b)
{
    const int64_t x = *(const int64_t *)a, y = *(const int64_t *)b;
    return (x > y) - (x < y);
}

enum { MANY = 20000 };

/* Values of all sizes are compared with the sorted list. */
static void percentiles_beside_a_sorted_list(void **state)
{
    (void)state;
    static int64_t ns[MANY];
    uint64_t seed = 7;
    for (int i = 0; i < MANY; i++) {
        ns[i] = case_between(&seed, 0, INT64_C(1) << (i % 40));
        lateness_note(&lateness, ns[i]);
    }
    qsort(ns, MANY, sizeof ns[0], by_size);
    for (int rank = 1; rank <= MANY; rank++)
        expect_us((rank - 0.5) / MANY, ns[rank - 1]); /* no quotient is rounded up to the next rank */
    assert_int_equal(lateness_count(&lateness), MANY);
}

/* Values lie at the borders of bins, up to the largest number. Each comes alone, and must be in its own row. */
static void rows_hold_what_is_below(void **state)
{
    (void)state;
    for (int bit = 0; bit < 63; bit++) {
        for (int64_t by = -1; by <= 1; by++) {
            const int64_t ns = bit < 62 || by < 0 ? (INT64_C(1) << bit) + by : INT64_MAX;
            uint64_t below_ns = 0, before_ns = 0, count, found = 0;
            memset(&lateness, 0, sizeof lateness);
            lateness_note(&lateness, ns);
            for (uint32_t i = 0; lateness_row(&lateness, i, &below_ns, &count); i++, before_ns = below_ns) {
                assert_true(below_ns > before_ns);
                if (count != 0) assert_true((uint64_t)ns >= before_ns && (uint64_t)ns < below_ns);
                found += count;
            }
            assert_int_equal(found, 1);
            assert_true(below_ns > (uint64_t)INT64_MAX);
            expect_us(0.5, ns);
        }
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup(none_is_late_by_nothing, begin),
        cmocka_unit_test_setup(percentiles_of_a_ramp, begin),
        cmocka_unit_test_setup(one_in_a_hundred, begin),
        cmocka_unit_test_setup(percentiles_beside_a_sorted_list, begin),
        cmocka_unit_test_setup(rows_hold_what_is_below, begin),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
