/* SPDX-License-Identifier: MIT */
/* A double is m 2^-s with a whole number m below 2^53. The double's product with a power of ten is exact in 128 bits,
 * unless s or the power is too large, which is rare. The product is rounded once, as printf rounds: ties to even. Then
 * the digits of a whole number remain to be written. printf writes all other doubles. */
#include "core/decimal.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "core/bytes.h"
#include "core/vecmath.h"
#include "core/wide.h"

enum { EIGHT_DIGITS = 100000000, MOST_DECIMALS = 22, MANTISSA_BITS = 52, EXPONENTS = 2047 };

/* Powers up to 10^19, the last one below 2^64. */
/* clang-format off */
static const uint64_t power_of_10[20] = {
    1, 10, 100, 1000, 10000, 100000, 1000000, 10000000, 100000000, 1000000000, 10000000000, 100000000000,
    1000000000000, 10000000000000, 100000000000000, 1000000000000000, 10000000000000000, 100000000000000000,
    1000000000000000000, 10000000000000000000u,
};
/* clang-format on */

/* ---- digits of whole numbers */

/* Returns the eight digits of v < 10^8, a byte each, the first digit in the lowest byte. Each step halves all fields of
 * a word at once: into numbers below 10^4, below 100, below 10. A division is a product with the reciprocal and a
 * shift, which is exact for numbers this small. */
static uint64_t eight_digits(uint32_t v)
{
    const uint64_t fours = v / 10000 | (uint64_t)(v % 10000) << 32;
    const uint64_t high = fours * 10486 >> 20 & 0x0000007f0000007f; /* 10486 = 2^20 / 100, rounded up */
    const uint64_t twos = high | (fours - 100 * high) << 16;
    const uint64_t tens = twos * 103 >> 10 & 0x000f000f000f000f; /* 103 = 2^10 / 10, rounded up */
    return tens | (twos - 10 * tens) << 8;
}

static const uint64_t ASCII_ZEROS = 0x3030303030303030;

/* Writes a whole number of n <= 20 digits, with zeros in front. */
static char *put_padded(char *to, uint64_t v, unsigned n)
{
    if (n > 8) {
        to = put_padded(to, v / EIGHT_DIGITS, n - 8);
        v %= EIGHT_DIGITS;
        n = 8;
    }
    le_put64(to, (eight_digits((uint32_t)v) + ASCII_ZEROS) >> 8 * (8 - n));
    return to + n;
}

static inline char *put_whole(char *to, uint64_t v)
{
    if (v >= EIGHT_DIGITS) return put_padded(decimal_put_whole(to, v / EIGHT_DIGITS), v % EIGHT_DIGITS, 8);
    const uint64_t digits = eight_digits((uint32_t)v);
    const unsigned n_zeros = (unsigned)__builtin_ctzll(digits | (uint64_t)1 << 56) / 8; /* the last digit stays */
    le_put64(to, (digits + ASCII_ZEROS) >> 8 * n_zeros);
    return to + 8 - n_zeros;
}

char *decimal_put_whole(char *to, uint64_t v)
{
    return put_whole(to, v);
}

/* Writes v / 10^decimals with all its decimals. */
static inline char *put_parts(char *to, uint64_t v, unsigned decimals)
{
    const uint64_t whole = decimals < 20 ? v / power_of_10[decimals] : 0; /* 10^20 is more than any v */
    to = put_whole(to, whole);
    if (decimals == 0) return to;
    *to++ = '.';
    return put_padded(to, decimals < 20 ? v - whole * power_of_10[decimals] : v, decimals);
}

/* Writes v > 0 as a whole number of n digits, without the zeros at its end. */
static char *put_stripped(char *to, uint64_t v, unsigned n)
{
    if (n > 8) {
        const uint64_t last = v % EIGHT_DIGITS;
        if (last == 0) return put_stripped(to, v / EIGHT_DIGITS, n - 8);
        to = put_padded(to, v / EIGHT_DIGITS, n - 8);
        v = last;
        n = 8;
    }
    const uint64_t digits = eight_digits((uint32_t)v);
    le_put64(to, (digits + ASCII_ZEROS) >> 8 * (8 - n));
    return to + n - __builtin_clzll(digits) / 8;
}

static inline __attribute__((always_inline)) char *put_short(char *to, uint64_t v, unsigned decimals)
{
    const uint64_t whole = decimals < 20 ? v / power_of_10[decimals] : 0;
    const uint64_t rest = decimals < 20 ? v - whole * power_of_10[decimals] : v;
    to = put_whole(to, whole);
    *to = '.';
    return rest > 0 ? put_stripped(to + 1, rest, decimals) : to;
}

char *decimal_put_short(char *to, uint64_t v, unsigned decimals)
{
    return decimals == 9 ? put_short(to, v, 9) : put_short(to, v, decimals); /* dividing by a constant is fast */
}

/* ---- doubles */

struct parts {
    uint64_t m; /* |v| = m / 2^s */
    int s;
};

static inline struct parts take_apart(double v)
{
    uint64_t bits;
    memcpy(&bits, &v, sizeof bits);
    const int exponent = (int)(bits >> MANTISSA_BITS & EXPONENTS);
    const uint64_t part = bits & (((uint64_t)1 << MANTISSA_BITS) - 1);
    return (struct parts){part | (uint64_t)(exponent != 0) << MANTISSA_BITS, 1075 - exponent};
}

/* Sets *whole to |v| 10^decimals, rounded. Returns 0 where that may have more than 64 bits. */
static inline int scale(struct parts v, u128 power, uint64_t *whole)
{
    *whole = 0;
    if (v.s > 127) return 1; /* below 2^-75, also a denormal: nothing of it is left */
    if (v.s < 1) return 0;   /* 2^52 and more, infinite, NaN */
    const u128 sum = power * v.m + ((u128)1 << (v.s - 1)), rounded = sum >> v.s;
    const int is_tie = sum << (128 - v.s) == 0;
    *whole = (uint64_t)rounded & ~(uint64_t)is_tie;
    return rounded >> 64 == 0;
}

/* The same in doubles; returns 0 where their rounding might change the result. The power is exact, so the relative
 * error of the product is at most 2^-53. Products too near a tie are left to scale(). */
static inline int scale_surely(double v, double power, uint64_t *whole)
{
    uint64_t bits;
    const double product = fabs(v) * power, rounded = vec_round(product, &bits);
    *whole = bits & 0x7ffffffffffff; /* the bits below 2^51: C can't convert a double that is too large */
    return product < 0x1p43 && fabs(product - rounded) < 0.5 - 0x1p-9;
}

/* All these powers are exact. */
static const double double_of_10[MOST_DECIMALS + 1] = {1e0,  1e1,  1e2,  1e3,  1e4,  1e5,  1e6,  1e7,
                                                       1e8,  1e9,  1e10, 1e11, 1e12, 1e13, 1e14, 1e15,
                                                       1e16, 1e17, 1e18, 1e19, 1e20, 1e21, 1e22};

static inline __attribute__((always_inline)) char *put_fixed(char *to, double v, unsigned decimals)
{
    uint64_t whole;
    const u128 power = decimals < 20 ? power_of_10[decimals] : (u128)10 * power_of_10[19];
    if (!scale_surely(v, double_of_10[decimals], &whole) && !scale(take_apart(v), power, &whole))
        return to + sprintf(to, "%.*f", (int)decimals, v);
    *to = '-';
    return put_parts(to + (signbit(v) != 0), whole, decimals);
}

char *decimal_put_fixed(char *to, double v, unsigned decimals)
{
    if (decimals == 6) return put_fixed(to, v, 6); /* dividing by a constant is fast */
    if (decimals == 9) return put_fixed(to, v, 9);
    return put_fixed(to, v, decimals);
}

/* Writes `whole`, a number of `digits` digits, in scientific notation. The point follows the first digit, which is not
 * 0. The power of ten is -22 to -5. */
static char *put_power(char *to, uint64_t whole, unsigned digits, int power)
{
    to = digits > 1 ? decimal_put_short(to, whole, digits - 1) : put_whole(to, whole);
    memcpy(to, "e-", 2);
    return put_padded(to + 2, (uint64_t)-power, 2);
}

static int scale_any(double v, int decimals, uint64_t *whole)
{
    if (decimals < 0 || decimals > MOST_DECIMALS) return 0;
    if (scale_surely(v, double_of_10[decimals], whole)) return 1;
    const u128 low = power_of_10[decimals % 20], high = decimals < 20 ? 1 : (u128)10 * power_of_10[19];
    return scale(take_apart(v), low * high, whole);
}

/* The number of decimals depends on the power of ten of the first digit. That power is estimated from the power of two
 * below |v|, and may be one too low. Then the number has one digit too many, and it is scaled again with one decimal
 * less. */
char *decimal_put_general(char *to, double v, unsigned digits)
{
    const int exponent = MANTISSA_BITS - take_apart(v).s; /* of two: 2^exponent <= |v| < 2^(exponent + 1) */
    int power = exponent * 78913 >> 18;                   /* log10(2) is 78913 / 2^18 */
    int decimals = (int)digits - 1 - power;
    uint64_t whole = 0;
    *to = '-';
    if (v == 0) return put_whole(to + (signbit(v) != 0), 0);
    int can = scale_any(v, decimals, &whole);
    if (can && whole >= power_of_10[digits]) {
        power++;
        decimals--;
        can = scale_any(v, decimals, &whole);
    }
    if (!can) return to + sprintf(to, "%.*g", (int)digits, v);
    to += signbit(v) != 0;
    if (power < -4) return put_power(to, whole, digits, power);
    return decimals > 0 ? decimal_put_short(to, whole, (unsigned)decimals) : put_whole(to, whole);
}

char *decimal_put_cells(char *to, const double *v, int n, unsigned digits)
{
    for (int i = 0; i < n; i++) {
        to = decimal_put_general(to, v[i], digits);
        *to++ = ',';
    }
    return to;
}
