/* SPDX-License-Identifier: MIT */
/* Whole numbers of 128 bits: products of two numbers of 64 bits are exact in them. */
#ifndef CORE_WIDE_H
#define CORE_WIDE_H

__extension__ typedef unsigned __int128 u128;

/* Returns the greatest common divisor. gcd(a, 0) is a. */
static inline u128 gcd(u128 a, u128 b)
{
    while (b != 0) {
        const u128 rest = a % b;
        a = b;
        b = rest;
    }
    return a;
}

#endif
