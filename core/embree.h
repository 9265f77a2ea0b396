/* SPDX-License-Identifier: MIT */
/* Embree 3 or 4. No other file includes Embree. This header also turns Embree's errors into ours. The Makefile chooses
 * the version (SH_EMBREE) with the library that it links. Point queries are the same in both. */
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

/* Turns an error of Embree into ours. */
int embree_fail(enum RTCError code, struct sh_err *err);

/* Whether Embree takes packets of that many rays (4, 8 or 16) as they are. Packets of 16 also need leaves for them
 * (bvh_has_wide). Embree divides packets of other sizes, and a leaf may then get rays of several packets at once. */
int embree_has_packet(RTCDevice device, uint32_t rays);
/* Rays a packet at which Embree is best on this machine: 16, 8, 4 or 1. */
uint32_t embree_packet(RTCDevice device);

/* Embree sorts a packet's directions by their signs, but treats components smaller than 1e-18 as positive
 * when it divides by them. With a component of -1e-22, all rays of the packet with the same signs would be
 * lost. So embree_direction makes no such components. */
VEC_INLINE float embree_direction(double d)
{
    float f = (float)d;
    return f < 0.0f && f > -1e-15f ? 0.0f : f;
}

#endif
