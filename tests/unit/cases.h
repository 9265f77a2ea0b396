/* For tests with many random cases: cmocka, and a generator of its own kind (xorshift64*, Vigna 2016), so
 * that the cases have nothing in common with the numbers under test. */
#ifndef TESTS_UNIT_CASES_H
#define TESTS_UNIT_CASES_H

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

static inline uint64_t case_u64(uint64_t *state)
{
    uint64_t x = *state;
    x ^= x >> 12;
    x ^= x << 25;
    x ^= x >> 27;
    *state = x;
    return x * 0x2545f4914f6cdd1dULL;
}

/* lo..hi, both included. The bias of the remainder doesn't matter to a choice of cases. */
static inline int64_t case_between(uint64_t *state, int64_t lo, int64_t hi)
{
    return lo + (int64_t)(case_u64(state) % ((uint64_t)(hi - lo) + 1));
}

/* 0 <= x < 1. */
static inline double case_unit(uint64_t *state)
{
    return (double)(case_u64(state) >> 11) * 0x1p-53;
}

#endif
