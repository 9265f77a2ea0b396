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
    RNG_MIRROR = 5, /* where the beam goes, line angle */
    RNG_PAN = 6,
    RNG_BALL = 7, /* ball-shaped noise: direction */
    RNG_BALL_RADIUS = 8,
    RNG_PLAN = 20, /* which pulses the plan looks at */
};

VEC_INLINE uint64_t rng_mix(uint64_t x)
{
    x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9ULL;
    x = (x ^ (x >> 27)) * 0x94d049bb133111ebULL;
    return x ^ (x >> 31);
}

/* Key of a stream; once per scan, not per pulse. */
VEC_INLINE uint64_t rng_key(uint64_t seed, enum rng_purpose purpose)
{
    return rng_mix(rng_mix(seed + 0x9e3779b97f4a7c15ULL) + (uint64_t)purpose * 0xd1b54a32d192ed03ULL);
}

/* What keeps the draws of a scan apart from those of all others, to be XORed into keys: the station and which
 * of its scans it is, both counted from 1. 0 for the first scan at the first station. Once per scan. */
VEC_INLINE uint64_t rng_scan(uint32_t station, uint32_t scan)
{
    return rng_mix((uint64_t)(station - 1) << 32 | (scan - 1));
}

VEC_INLINE uint64_t rng_u64(uint64_t key, uint64_t pulse)
{
    return rng_mix(rng_mix(pulse * 0x9e3779b97f4a7c15ULL + key) ^ key);
}

/* What to ask with for an echo of a pulse: number counts from 0, so that a pulse's only echo is asked for by
 * the pulse. Pulse numbers stay below 2^56. */
VEC_INLINE uint64_t rng_echo(uint64_t pulse, uint32_t number)
{
    return pulse | (uint64_t)number << 56;
}

/* Standard normal, by Box and Muller: radius from the upper 32 bits, angle from the lower 32. The largest is
 * 6.7. cos(2 pi a) = sin(2 pi y), y = |a - 1/2| - 1/4, by the Taylor series to the 15th power: error below
 * 7e-12 at the ends. */
VEC_INLINE double rng_normal(uint64_t key, uint64_t pulse)
{
    uint64_t bits = rng_u64(key, pulse);
    double u = ((double)(int64_t)(bits >> 32) + 0.5) * 0x1p-32;
    double y = VEC_TURN_RAD * (fabs((double)(int64_t)(bits & 0xffffffffU) * 0x1p-32 - 0.5) - 0.25), z = y * y;
    double s = -1.0 / 1307674368000.0;
    s = s * z + 1.0 / 6227020800.0;
    s = s * z - 1.0 / 39916800.0;
    s = s * z + 1.0 / 362880.0;
    s = s * z - 1.0 / 5040.0;
    s = s * z + 1.0 / 120.0;
    s = s * z - 1.0 / 6.0;
    return sqrt(-2.0 * vec_log(u)) * (y + y * (z * s));
}

#endif
