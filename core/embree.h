/* SPDX-License-Identifier: MIT */
/* Embree 3 or 4: the one place that includes it, and what its errors mean. Which one, the Makefile decides
 * (SH_EMBREE), with the library that it links. Point queries are the same in both. */
#ifndef CORE_EMBREE_H
#define CORE_EMBREE_H

#if SH_EMBREE == 3
#include <embree3/rtcore.h>
#elif SH_EMBREE == 4
#include <embree4/rtcore.h>
#else
#error "SH_EMBREE is 3 or 4, as the Makefile says it"
#endif

#include <stdint.h>

#include "core/err.h"
#include "core/vecmath.h"

/* The error that one of Embree's is. what: what was to be made. */
int embree_fail(enum RTCError code, const char *what, struct sh_err *err);

/* Whether it takes packets of 4, 8 or 16 rays as they are. Others it takes apart, and a leaf gets rays of several. */
int embree_has_packet(RTCDevice device, uint32_t rays);
/* Rays a packet at which Embree is best on this machine: 16, 8, 4 or 1. */
uint32_t embree_packet(RTCDevice device);

/* Embree sorts a packet's directions by their signs, but takes what is smaller than 1e-18 for positive when
 * it divides by it: with a component of -1e-22, all rays of that packet with its signs would be lost. So
 * there are none. */
VEC_INLINE float embree_direction(double d)
{
    float f = (float)d;
    return f < 0.0f && f > -1e-15f ? 0.0f : f;
}

#endif
