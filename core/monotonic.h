/* SPDX-License-Identifier: MIT */
/* The monotonic clock, for code that prepares a scene or waits. Nothing on the way of a pulse reads it. Real-time
 * safe. */
#ifndef CORE_MONOTONIC_H
#define CORE_MONOTONIC_H

#include <stdint.h>
#include <time.h>

static inline int64_t monotonic_ns(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (int64_t)t.tv_sec * 1000000000 + t.tv_nsec;
}

#endif
