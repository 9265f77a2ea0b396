/* SPDX-License-Identifier: MIT */
/* A double is m 2^-s with a whole number m below 2^53. Its product with a power of ten is exact in 128 bits, where s and the
 * power are not too large: nearly always. So it is rounded once, as printf rounds, to even where it lies in the middle.
 * What is left is the digits of a whole number. All other doubles go to printf. */
#include "core/decimal.h"

#include <stdio.h>
#include <string.h>

#include "core/bytes.h"

__extension__ typedef unsigned __int128 u128;

enum { EIGHT_DIGITS = 100000000, MOST_DECIMALS = 22, MANTISSA_BITS = 52, EXPONENTS = 2047 };

/* Up to 10^19, which is the last one below 2^64. */
static const uint64_t power_of_10[20] = {1,
                                         10,
                                         100,
                                         1000,
                                         10000,
                                         100000,
                                         1000000,
                                         10000000,
                                         100000000,
                                         1000000000,
                                         10000000000,
                                         100000000000,
                                         1000000000000,
                                         10000000000000,
                                         100000000000000,
                                         1000000000000000,
                                         10000000000000000,
                                         100000000000000000,
                                         1000000000000000000,
                                         10000000000000000000u};

/* ---- digits of whole numbers */

/* The eight digits of v < 10^8, a byte each, the first one in the lowest byte. Each step halves fields of a word, all at
 * once: into numbers below 10^4, below 100, below 10. A division is a product with the reciprocal, exact for such small
 * numbers, and a shift. */
static uint64_t eight_digits(uint32_t v)
{
    const uint64_t fours = v / 10000 | (uint64_t)(v % 10000) << 32;
    const uint64_t high = fours * 10486 >> 20 & 0x0000007f0000007f; /* 10486 = 2^20 / 100, rounded up */
    const uint64_t twos = high | (fours - 100 * high) << 16;
    const uint64_t tens = twos * 103 >> 10 & 0x000f000f000f000f; /* 103 = 2^10 / 10, rounded up */
    return tens | (twos - 10 * tens) << 8;
}

static const uint64_t ASCII_ZEROS = 0x3030303030303030;

/* A whole number of n <= 20 digits, with zeros in front. */
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

/* v / 10^decimals with all its decimals. */
static inline char *put_parts(char *to, uint64_t v, unsigned decimals)
{
    const uint64_t whole = decimals < 20 ? v / power_of_10[decimals] : 0; /* 10^20 is more than any v */
    to = put_whole(to, whole);
    if (decimals == 0) return to;
    *to++ = '.';
    return put_padded(to, decimals < 20 ? v - whole * power_of_10[decimals] : v, decimals);
}

char *decimal_put_short(char *to, uint64_t v, unsigned decimals)
{
    to = put_parts(to, v, decimals);
    while (to[-1] == '0')
        to--;
    return to - (to[-1] == '.');
}

/* ---- doubles */

struct parts {
    uint64_t m; /* |v| = m / 2^s */
    int s, is_negative;
};

static inline struct parts take_apart(double v)
{
    uint64_t bits;
    memcpy(&bits, &v, sizeof bits);
    const int exponent = (int)(bits >> MANTISSA_BITS & EXPONENTS);
    const uint64_t part = bits & (((uint64_t)1 << MANTISSA_BITS) - 1);
    return (struct parts){part | (uint64_t)(exponent != 0) << MANTISSA_BITS, 1075 - exponent, bits >> 63 != 0};
}

/* |v| 10^decimals, rounded. 0: it may have more than 64 bits. */
static inline int scale(struct parts v, u128 power, uint64_t *whole)
{
    *whole = 0;
    if (v.s > 127) return 1; /* below 2^-75, also a denormal: nothing of it is left */
    if (v.s < 1) return 0;   /* 2^53 and more, infinite, NaN */
    const u128 sum = power * v.m + ((u128)1 << (v.s - 1)), rounded = sum >> v.s;
    const int is_tie = sum << (128 - v.s) == 0;
    *whole = (uint64_t)rounded & ~(uint64_t)is_tie;
    return rounded >> 64 == 0;
}

static inline __attribute__((always_inline)) char *put_fixed(char *to, double v, unsigned decimals)
{
    const struct parts parts = take_apart(v);
    const u128 power = decimals < 20 ? power_of_10[decimals] : (u128)10 * power_of_10[19];
    uint64_t whole;
    if (!scale(parts, power, &whole)) return to + sprintf(to, "%.*f", (int)decimals, v);
    *to = '-';
    return put_parts(to + parts.is_negative, whole, decimals);
}

char *decimal_put_fixed(char *to, double v, unsigned decimals)
{
    if (decimals == 6) return put_fixed(to, v, 6); /* a division by a known number is a product */
    if (decimals == 9) return put_fixed(to, v, 9);
    return put_fixed(to, v, decimals);
}

/* A number of `digits` digits, the first one not 0, with the point after it, and a power of ten from 10^-22 on. */
static char *put_power(char *to, uint64_t whole, unsigned digits, int power)
{
    to = digits > 1 ? decimal_put_short(to, whole, digits - 1) : put_whole(to, whole);
    memcpy(to, "e-", 2);
    return put_padded(to + 2, (uint64_t)-power, 2);
}

/* The decimals depend on the power of ten of the first digit. That of the power of two below |v| is the same, or one less. */
char *decimal_put_general(char *to, double v, unsigned digits)
{
    const struct parts parts = take_apart(v);
    const int exponent = MANTISSA_BITS - parts.s; /* of two: 2^exponent <= |v| < 2^(exponent + 1) */
    int power = exponent * 78913 >> 18;           /* log10(2) is 78913 / 2^18 */
    int decimals = (int)digits - 1 - power;
    uint64_t whole = 0;
    *to = '-';
    if (v == 0) return put_whole(to + parts.is_negative, 0);
    if (decimals < 0 || decimals > MOST_DECIMALS || parts.s < 1 || parts.s > 127)
        return to + sprintf(to, "%.*g", (int)digits, v);
    u128 ten = decimals < 20 ? power_of_10[decimals] : (u128)power_of_10[decimals - 19] * power_of_10[19];
    if (ten * parts.m >> parts.s >= power_of_10[digits]) {
        power++;
        decimals--;
        ten /= 10;
    }
    if (decimals < 0 || !scale(parts, ten, &whole)) return to + sprintf(to, "%.*g", (int)digits, v);
    if (whole == power_of_10[digits]) { /* rounded up to the next power of ten */
        power++;
        decimals--;
        whole /= 10;
    }
    if (decimals < 0) return to + sprintf(to, "%.*g", (int)digits, v);
    to += parts.is_negative;
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
