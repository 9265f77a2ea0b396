/* SPDX-License-Identifier: MIT */
#include "tests/bench/pin.h"

#include <stddef.h>

void pin(cpu_set_t *before)
{
    cpu_set_t one;
    int cpu = sched_getcpu();
    if (before != NULL && sched_getaffinity(0, sizeof *before, before) != 0) CPU_ZERO(before);
    CPU_ZERO(&one);
    CPU_SET(cpu < 0 ? 0U : (unsigned)cpu, &one);
    sched_setaffinity(0, sizeof one, &one);
}

void unpin(const cpu_set_t *before)
{
    if (CPU_COUNT(before) != 0) sched_setaffinity(0, sizeof *before, before);
}
