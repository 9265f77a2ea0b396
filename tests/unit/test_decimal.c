/* SPDX-License-Identifier: MIT */
/* core/decimal.h: each text has the bytes that libc's printf writes, for doubles of all sizes, ties, and borders. */
#include "tests/common/cases.h"

#include <float.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/decimal.h"
#include "tests/common/thorough.h"

enum { CASES = 20000, MOST_DECIMALS = 20, MOST_DIGITS = 17, MARK = '#' };

static uint64_t state_of_random = 0x9e3779b97f4a7c15;

static uint64_t random_bits(void)
{
    return case_u64(&state_of_random);
}

static double of_bits(uint64_t bits)
{
    double v;
    memcpy(&v, &bits, sizeof v);
    return v;
}

static char got[DECIMAL_FIXED_ROOM + 1];

/* Checks the text, and that nothing was written beyond the room. */
static void expect(const char *want, const char *end, size_t room, const char *what, double v)
{
    const size_t n = strlen(want);
    if ((size_t)(end - got) != n || memcmp(got, want, n) != 0)
        fail_msg("%s of %a is %.*s; printf writes %s", what, v, (int)(end - got), got, want);
    assert_int_equal(got[room], MARK);
}

static void check_fixed(double v, unsigned decimals)
{
    char want[DECIMAL_FIXED_ROOM], what[16];
    snprintf(want, sizeof want, "%.*f", (int)decimals, v);
    snprintf(what, sizeof what, "%%.%uf", decimals);
    got[DECIMAL_FIXED_ROOM] = MARK;
    expect(want, decimal_put_fixed(got, v, decimals), DECIMAL_FIXED_ROOM, what, v);
}

static void check_general(double v, unsigned digits)
{
    char want[DECIMAL_GENERAL_ROOM], what[16];
    snprintf(want, sizeof want, "%.*g", (int)digits, v);
    snprintf(what, sizeof what, "%%.%ug", digits);
    got[DECIMAL_GENERAL_ROOM] = MARK;
    expect(want, decimal_put_general(got, v, digits), DECIMAL_GENERAL_ROOM, what, v);
}

static void check_all(double v)
{
    for (unsigned n = 0; n <= MOST_DECIMALS; n++) {
        check_fixed(v, n);
        check_fixed(-v, n);
    }
    for (unsigned n = 1; n <= MOST_DIGITS; n++) {
        check_general(v, n);
        check_general(-v, n);
    }
}

/* ---- tests */

static void test_borders(void **state)
{
    (void)state;
    static const double v[] = {0,
                               1,
                               DBL_MIN,
                               DBL_MAX,
                               DBL_TRUE_MIN,
                               HUGE_VAL,
                               0x1p52,
                               0x1p53,
                               0x1p63,
                               0x1p64,
                               9e6,
                               0.1,
                               0.3,
                               1e-4,
                               1e-5,
                               9.9999995e-5,
                               999999.5,
                               9999995,
                               1e22,
                               0x1.fffffep-1,
                               0.999999999999,
                               1e17,
                               1e-17,
                               1.8446744073709551615e13,
                               0.18446744073709551615};
    for (size_t i = 0; i < sizeof v / sizeof *v; i++) {
        check_all(v[i]);
        check_all(nextafter(v[i], 0));
        check_all(nextafter(v[i], HUGE_VAL));
    }
    check_all((double)NAN);
    for (int k = -30; k <= 30; k++) { /* powers of ten and their neighbours */
        check_all(pow(10, k));
        check_all(nextafter(pow(10, k), 0));
        check_all(5 * pow(10, k));
    }
}

/* k / 2^n lies in the middle between two texts of n - 1 decimals. */
static void test_ties(void **state)
{
    (void)state;
    for (unsigned n = 1; n <= MOST_DECIMALS + 1; n++)
        for (int i = 0; i < 200; i++) {
            const double v = ldexp((double)(random_bits() >> 34 | 1), -(int)n);
            check_fixed(v, n - 1);
            check_fixed(nextafter(v, 0), n - 1);
            check_fixed(nextafter(v, HUGE_VAL), n - 1);
            check_general(v, (unsigned)i % MOST_DIGITS + 1);
        }
}

/* Random bits give all exponents; coordinates have the sizes that files hold. */
static void test_random(void **state)
{
    (void)state;
    const int n = thorough(50 * CASES, CASES);
    for (int i = 0; i < n; i++) {
        const uint64_t bits = random_bits();
        const double any = of_bits(bits),
                     coordinate = ((double)(bits >> 11) * 0x1p-53 - 0.5) * pow(10, (double)(bits % 12) - 4);
        check_fixed(any, (unsigned)(bits % (MOST_DECIMALS + 1)));
        check_general(any, (unsigned)(bits % MOST_DIGITS) + 1);
        check_fixed(coordinate, i % 4 == 0 ? 9 : i % 4 == 1 ? 2 : 6);
        check_general(coordinate, i % 2 == 0 ? 9 : 6);
        check_general((double)(float)coordinate, (unsigned)(bits % MOST_DIGITS) + 1);
        check_fixed(rint(coordinate * 1e3) / 1e3, 6); /* a stream's scale */
    }
}

static void test_whole(void **state)
{
    (void)state;
    char want[DECIMAL_WHOLE_ROOM];
    for (int i = 0; i < CASES; i++) {
        uint64_t v = random_bits() >> i % 64;
        if (i < 100)
            v = i < 20   ? (uint64_t)pow(10, i) - 1
                : i < 40 ? (uint64_t)pow(10, i - 20)
                : i < 99 ? (uint64_t)i
                         : UINT64_MAX;
        snprintf(want, sizeof want, "%llu", (unsigned long long)v);
        got[DECIMAL_WHOLE_ROOM] = MARK;
        expect(want, decimal_put_whole(got, v), DECIMAL_WHOLE_ROOM, "%llu", (double)v);
    }
}

/* The expected text is made of the whole number's digits. */
static void test_short(void **state)
{
    (void)state;
    for (int i = 0; i < CASES; i++) {
        const unsigned decimals = (unsigned)i % MOST_DECIMALS + 1;
        char digits[32], want[40];
        uint64_t v = random_bits() >> i % 64;
        for (int k = i % 7; k > 0; k--)
            v -= v % (uint64_t)pow(10, k); /* zeros at its end */
        const int n = snprintf(digits, sizeof digits, "%0*llu", (int)decimals + 1, (unsigned long long)v);
        int len = snprintf(want, sizeof want, "%.*s.%s", n - (int)decimals, digits, digits + n - decimals);
        while (want[len - 1] == '0')
            len--;
        want[want[len - 1] == '.' ? len - 1 : len] = '\0';
        got[DECIMAL_GENERAL_ROOM] = MARK;
        expect(want, decimal_put_short(got, v, decimals), DECIMAL_GENERAL_ROOM, "short", (double)v);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_borders), cmocka_unit_test(test_ties),  cmocka_unit_test(test_random),
        cmocka_unit_test(test_whole),   cmocka_unit_test(test_short),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
