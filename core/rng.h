/* SPDX-License-Identifier: MIT */
/* The one random generator: counter-based, so that a number depends on (seed, station, scan, pulse, echo,
 * purpose) and on nothing else.
 *
 * Two rounds of the SplitMix64 finaliser (Steele, Lea, Flood, OOPSLA 2014; constants by Stafford, "mix 13")
 * over the pulse number, each keyed. Pure; any thread. */
#ifndef CORE_RNG_H
#define CORE_RNG_H

#include <math.h>
#include <stdint.h>

#include "core/vecmath.h"

enum rng_purpose {
    RNG_RANGE = 1,
    RNG_SCENE = 2,
    RNG_GNSS = 3,
    RNG_SIGNAL = 4, /* of the detector */
    RNG_MIRROR = 5, /* line angle of the true beam */
    RNG_PAN = 6,
    RNG_BALL = 7, /* ball-shaped noise: direction */
    RNG_BALL_RADIUS = 8,
    RNG_FAULT = 9,     /* injected faults */
    RNG_PTP = 10,      /* measurements of the PTP follower */
    RNG_WAVEFORM = 11, /* of the samples of waveforms */
    RNG_SPARSE = 16,   /* points spread over a mesh */
    RNG_PLAN = 20,     /* which pulses the plan looks at */
};

VEC_INLINE uint64_t rng_mix(uint64_t x)
{
    x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9ULL;
    x = (x ^ (x >> 27)) * 0x94d049bb133111ebULL;
    return x ^ (x >> 31);
}

/* Mixes the numbers of a place into a hash. -0 counts as 0, so that places that compare as equal have one hash. */
static inline uint64_t rng_place(uint64_t hash, const double p[3])
{
    for (int i = 0; i < 3; i++) {
        const double x = p[i] + 0.0;
        uint64_t bits;
        memcpy(&bits, &x, sizeof bits);
        hash = rng_mix(hash + 0x9e3779b97f4a7c15ULL + bits);
    }
    return hash;
}

/* The key of a purpose's random numbers. The key is computed once per scan, not per pulse. */
VEC_INLINE uint64_t rng_key(uint64_t seed, enum rng_purpose purpose)
{
    return rng_mix(rng_mix(seed + 0x9e3779b97f4a7c15ULL) + (uint64_t)purpose * 0xd1b54a32d192ed03ULL);
}

/* Returns a number that is XORed into keys, so that each scan draws other numbers. The result depends on the station
 * and the number of its scan, both counted from 1. The result is 0 for the first scan at the first station, and is
 * computed once per scan. */
VEC_INLINE uint64_t rng_scan(uint32_t station, uint32_t scan)
{
    return rng_mix((uint64_t)(station - 1) << 32 | (scan - 1));
}

VEC_INLINE uint64_t rng_u64(uint64_t key, uint64_t pulse)
{
    return rng_mix(rng_mix(pulse * 0x9e3779b97f4a7c15ULL + key) ^ key);
}

/* The key of a pulse's echo. number counts from 0, so that a pulse's only echo has the pulse number as its
 * key. Pulse numbers stay below 2^56. */
VEC_INLINE uint64_t rng_echo(uint64_t pulse, uint32_t number)
{
    return pulse | (uint64_t)number << 56;
}

/* -2 log((h + 1/2) / 2^32). h + 1/2 = 2^k m with m in [sqrt(1/2), sqrt(2)), log m = 2 artanh t, t = (m - 1) /
 * (m + 1). 4 artanh(t) / t by the polynomial in t^2 that meets it at Chebyshev's nodes: relative error 4.3e-12. */
VEC_INLINE double rng_radius2(uint64_t h)
{
    const uint64_t whole = h | 0x4330000000000000ULL; /* 2^52 + h */
    uint64_t bits;
    double x, half_m, k1;
    memcpy(&x, &whole, sizeof x);
    x -= 0x1p52 - 0.5;
    memcpy(&bits, &x, sizeof bits);
    const uint64_t from = bits - 0x3fd6a09e667f3bcdULL; /* bits of sqrt(1/2) / 2: the exponent is k + 1, not below 0 */
    const uint64_t half_bits = bits - (from & 0xfff0000000000000ULL), k_bits = from >> 52 | 0x4330000000000000ULL;
    memcpy(&half_m, &half_bits, sizeof half_m);
    memcpy(&k1, &k_bits, sizeof k1);
    double t = (half_m - 0.5) / (half_m + 0.5), z = t * t, z2 = z * z;
    double p = (4.000000000016719 + z * 1.3333333049497504) +
               z2 * ((0.8000076934475038 + z * 0.5707010207563262) + z2 * 0.47232718198291973);
    return ((0x1p52 + 33.0) - k1) * 1.3862943611198906 - t * p;
}

/* cos(2 pi l / 2^32) = sin(2 pi w), w = |l / 2^32 - 1/2| - 1/4. sin(2 pi w) / w by the polynomial in w^2 that
 * meets it at Chebyshev's nodes: relative error 8e-14. */
VEC_INLINE double rng_cosine(uint64_t l)
{
    const uint64_t bits = l | 0x4130000000000000ULL; /* 2^20 + l / 2^32 */
    double x;
    memcpy(&x, &bits, sizeof x);
    double w = fabs(x - (0x1p20 + 0.5)) - 0.25, v = w * w, v2 = v * v, v4 = v2 * v2;
    double p = ((6.28318530717927 - v * 41.341702239903675) + v2 * (81.60524914901583 - v * 76.70584754377326)) +
               v4 * ((42.058134871372054 - v * 15.081483206893) + v2 * 3.6658551595639612);
    return w * p;
}

/* Standard normal from 64 random bits, by Box and Muller: radius from the upper 32 bits, angle from the lower
 * 32. The largest is 6.8. The error of the arithmetic is below 4e-12 (tests/unit/test_rng.c); steps of the angle are
 * 1000 times as large. */
VEC_INLINE double rng_normal_of(uint64_t bits)
{
    return sqrt(rng_radius2(bits >> 32)) * rng_cosine(bits & 0xffffffffU);
}

VEC_INLINE double rng_normal(uint64_t key, uint64_t pulse)
{
    return rng_normal_of(rng_u64(key, pulse));
}

/* Arrays are filled in blocks: first the random bits of a block, then the numbers made from them. A processor
 * overlaps more passes of two short loops than of one long one. Returns how many numbers of 64 bits it made. */
enum { RNG_BLOCK = 64 };
VEC_INLINE uint32_t rng_bits(uint64_t key, const uint64_t *restrict pulse, uint32_t n, uint64_t bits[RNG_BLOCK])
{
    const uint32_t m = n < (uint32_t)RNG_BLOCK ? n : (uint32_t)RNG_BLOCK;
    for (uint32_t i = 0; i < m; i++)
        bits[i] = rng_u64(key, pulse[i]);
    return m;
}

#endif
