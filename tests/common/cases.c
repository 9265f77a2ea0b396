/* SPDX-License-Identifier: MIT */
#include "tests/common/cases.h"

uint64_t case_u64(uint64_t *state)
{
    uint64_t x = *state;
    x ^= x >> 12;
    x ^= x << 25;
    x ^= x >> 27;
    *state = x;
    return x * 0x2545f4914f6cdd1dULL;
}

int64_t case_between(uint64_t *state, int64_t lo, int64_t hi)
{
    return (int64_t)((uint64_t)lo + case_u64(state) % ((uint64_t)hi - (uint64_t)lo + 1));
}

double case_unit(uint64_t *state)
{
    return (double)(case_u64(state) >> 11) * 0x1p-53;
}
