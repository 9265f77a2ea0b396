/* SPDX-License-Identifier: MIT */
/* Private to core/sight: four doubles at a time, by hand, where compilers leave a loop as it is. Vectors are passed by
 * address: without AVX, compilers warn of a changed calling convention. */
#ifndef CORE_SIGHT_QUAD_H
#define CORE_SIGHT_QUAD_H

#include "core/vecmath.h"

enum { QUAD_LANES = 4 };
typedef double quad __attribute__((vector_size(32)));
typedef int64_t quad_mask __attribute__((vector_size(32)));

/* Replaces *no by *yes in the lanes that `which` sets. */
VEC_INLINE void quad_choose(const quad_mask *which, const quad *yes, quad *no)
{
    *no = (quad)(((quad_mask)*yes & *which) | ((quad_mask)*no & ~*which));
}

#endif
