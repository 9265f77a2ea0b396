/* SPDX-License-Identifier: MIT */
/* Arithmetic that compilers turn into vectors: branch-free, the same bits on every instruction set (no FMA
 * contraction, see the Makefile), for loops over arrays. */
#ifndef CORE_VECMATH_H
#define CORE_VECMATH_H

#include <stdint.h>
#include <string.h>

/* Builds a function in several versions; the best one for the CPU at hand is chosen once at start. With VEC_ONE, for
 * measuring, there is only the version of the compiler's options. Sanitizers can't follow the resolver. Clang before
 * version 18 gives the resolver a name that other files don't find (llvm-project pull request 71706). */
#if defined(VEC_ONE) || (defined(__clang__) && __clang_major__ < 18)
#define VEC_CLONES
#elif defined(__x86_64__) && !defined(SH_SANITIZE) && defined(__clang__)
#define VEC_CLONES __attribute__((target_clones("avx512f", "avx2", "default")))
#elif defined(__x86_64__) && !defined(SH_SANITIZE) && defined(__GNUC__)
#define VEC_CLONES __attribute__((target_clones("arch=x86-64-v4", "arch=x86-64-v3", "default")))
#else
#define VEC_CLONES
#endif
#define VEC_INLINE static inline __attribute__((always_inline))
/* Stands before a loop over arrays that don't overlap, where `restrict` can't say so, since a struct has them. */
#ifdef __clang__
#define VEC_LOOP _Pragma("clang loop vectorize(assume_safety)")
#else
#define VEC_LOOP _Pragma("GCC ivdep")
#endif

static const double VEC_TURN_RAD = 6.283185307179586477;

/* Nearest whole number of |x| < 2^51, ties to even, as a double and in the low bits of *bits. */
VEC_INLINE double vec_round(double x, uint64_t *bits)
{
    const double magic = 6755399441055744.0; /* 1.5 * 2^52 */
    double shifted = x + magic;
    memcpy(bits, &shifted, sizeof *bits);
    return shifted - magic;
}

/* A whole number below 2^52 as a double. Vector instructions before AVX-512 can't convert 64-bit numbers. */
VEC_INLINE double vec_from_u64(uint64_t whole)
{
    const uint64_t bits = whole | 0x4330000000000000ULL; /* 2^52 + whole */
    double x;
    memcpy(&x, &bits, sizeof x);
    return x - 0x1p52;
}

/* Adds the lower terms of the Taylor series of (sin y - y) / y^3, where z = y^2. The caller gives the sum of the higher
 * terms, s. */
VEC_INLINE double vec_sine_series(double s, double z)
{
    s = s * z + 1.0 / 6227020800.0;
    s = s * z - 1.0 / 39916800.0;
    s = s * z + 1.0 / 362880.0;
    s = s * z - 1.0 / 5040.0;
    s = s * z + 1.0 / 120.0;
    s = s * z - 1.0 / 6.0;
    return s;
}

/* The terms of (cos y - 1 + y^2 / 2) / y^4 up to y^16, z = y^2. */
VEC_INLINE double vec_cosine_series(double z)
{
    double c = 1.0 / 20922789888000.0;
    c = c * z - 1.0 / 87178291200.0;
    c = c * z + 1.0 / 479001600.0;
    c = c * z - 1.0 / 3628800.0;
    c = c * z + 1.0 / 40320.0;
    c = c * z - 1.0 / 720.0;
    c = c * z + 1.0 / 24.0;
    return c;
}

/* Sine and cosine of an angle in turns, |turn| < 2^49: reduction to an eighth of a turn is exact, then Taylor
 * series to y^15 and y^16 with |y| <= pi/4, whose remainders are below 5e-17. Error below 2.5e-16
 * (tests/unit/test_vecmath.c). */
VEC_INLINE void vec_sincos_turn(double turn, double *sine, double *cosine)
{
    uint64_t quadrant;
    double q = vec_round(4.0 * turn, &quadrant);
    double y = (turn - 0.25 * q) * 6.283185307179586477;
    double z = y * y;
    double s = -1.0 / 1307674368000.0;
    s = vec_sine_series(s, z);
    s = y + y * (z * s);
    double c = vec_cosine_series(z);
    c = c * z - 0.5;
    c = 1.0 + z * c;
    double a = quadrant & 1 ? c : s, b = quadrant & 1 ? s : c;
    *sine = quadrant & 2 ? -a : a;
    *cosine = (quadrant + 1) & 2 ? -b : b;
}

/* x * y - product, exact, where the product is x * y rounded: Dekker's (1971), with Veltkamp's splitting. */
VEC_INLINE double vec_product_rest(double x, double y, double product)
{
    double xs = 134217729.0 * x, ys = 134217729.0 * y; /* 2^27 + 1 */
    double xh = xs - (xs - x), yh = ys - (ys - y), xl = x - xh, yl = y - yh;
    return ((xh * yh - product) + xh * yl + xl * yh) + xl * yl;
}

/* x + y - sum, exact, where the sum is x + y rounded: Knuth's. */
VEC_INLINE double vec_sum_rest(double x, double y, double sum)
{
    double t = sum - x;
    return (x - (sum - t)) + (y - t);
}

/* Sine and cosine of the angle turn + rest, where |rest| is at most the last bit of turn. Each result is a sum of two
 * doubles, [0] + [1], and [1] is at most half the last bit of [0]. The series of the sine goes to y^17. Error below
 * 4e-17 (tests/unit/test_vecmath.c). */
VEC_INLINE void vec_sincos_turn_fine(double turn, double rest, double sine[2], double cosine[2])
{
    const double two_pi = 6.283185307179586477, two_pi_rest = 2.4492935982947064e-16;
    uint64_t quadrant;
    double q = vec_round(4.0 * turn, &quadrant), f = turn - 0.25 * q;
    double y = f * two_pi, y1 = vec_product_rest(f, two_pi, y) + (f * two_pi_rest + rest * two_pi);
    double z = y * y, z1 = vec_product_rest(y, y, z);
    double s = 1.0 / 355687428096000.0;
    s = s * z - 1.0 / 1307674368000.0;
    s = vec_sine_series(s, z);
    s = y * (z * s);
    double c = vec_cosine_series(z);
    c = z * (z * c);
    double half = 0.5 * z, sh = y + s, ch = 1.0 - half;
    double sl = (y - sh + s) + y1 * (ch + c), cl = (1.0 - ch - half) + (c - 0.5 * z1 - y1 * sh);
    double s0 = sh + sl, s1 = sh - s0 + sl, c0 = ch + cl, c1 = ch - c0 + cl;
    double a = quadrant & 1 ? c0 : s0, b = quadrant & 1 ? s0 : c0;
    double a1 = quadrant & 1 ? c1 : s1, b1 = quadrant & 1 ? s1 : c1;
    sine[0] = quadrant & 2 ? -a : a;
    sine[1] = quadrant & 2 ? -a1 : a1;
    cosine[0] = (quadrant + 1) & 2 ? -b : b;
    cosine[1] = (quadrant + 1) & 2 ? -b1 : b1;
}

/* Natural logarithm of a normal positive number: x = 2^e m, m in [sqrt(1/2), sqrt(2)), log m = 2
 * artanh((m-1)/(m+1)) by its series to the 21st power, whose remainder is below 1e-17; relative error below
 * 1e-15 away from x = 1. */
VEC_INLINE double vec_log(double x)
{
    uint64_t bits;
    memcpy(&bits, &x, sizeof bits);
    uint64_t shifted = bits - 0x3fe6a09e667f3bcdULL; /* bits of sqrt(1/2) */
    uint64_t mbits = bits - (shifted & 0xfff0000000000000ULL);
    double m, k = vec_from_u64(shifted >> 52 ^ 2048) - 2048.0; /* the exponent has a sign */
    memcpy(&m, &mbits, sizeof m);
    double t = (m - 1.0) / (m + 1.0), z = t * t;
    double p = 1.0 / 21.0;
    p = p * z + 1.0 / 19.0;
    p = p * z + 1.0 / 17.0;
    p = p * z + 1.0 / 15.0;
    p = p * z + 1.0 / 13.0;
    p = p * z + 1.0 / 11.0;
    p = p * z + 1.0 / 9.0;
    p = p * z + 1.0 / 7.0;
    p = p * z + 1.0 / 5.0;
    p = p * z + 1.0 / 3.0;
    return k * 0.693147180559945309 + 2.0 * (t + t * (z * p));
}

/* e^x; x below -700 or above 700 counts as that limit. x = k log 2 + r, |r| <= log(2)/2, and the Taylor series to
 * r^13, whose remainder is below 1e-17; relative error below 1e-15 (tests/unit/test_vecmath.c). */
VEC_INLINE double vec_exp(double x)
{
    uint64_t bits;
    double within = x < -700.0 ? -700.0 : x > 700.0 ? 700.0 : x;
    double k = vec_round(within * 1.4426950408889634, &bits);
    double r = (within - k * 6.93147180369123816490e-01) - k * 1.90821492927058770002e-10;
    double p = 1.0 / 6227020800.0;
    p = p * r + 1.0 / 479001600.0;
    p = p * r + 1.0 / 39916800.0;
    p = p * r + 1.0 / 3628800.0;
    p = p * r + 1.0 / 362880.0;
    p = p * r + 1.0 / 40320.0;
    p = p * r + 1.0 / 5040.0;
    p = p * r + 1.0 / 720.0;
    p = p * r + 1.0 / 120.0;
    p = p * r + 1.0 / 24.0;
    p = p * r + 1.0 / 6.0;
    p = p * r + 0.5;
    p = p * r + 1.0;
    p = p * r + 1.0;
    uint64_t power = (bits + 1023) << 52; /* the low bits are k in two's complement; the shift drops the others */
    double scale;
    memcpy(&scale, &power, sizeof scale);
    return p * scale;
}

#endif
