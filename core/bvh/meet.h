/* SPDX-License-Identifier: MIT */
/* Private to core/bvh: a packet meets a leaf. */
#ifndef CORE_BVH_MEET_H
#define CORE_BVH_MEET_H

#include "core/embree.h"

/* Embree's callback. */
void bvh_meet_leaf(const struct RTCIntersectFunctionNArguments *args);

#endif
