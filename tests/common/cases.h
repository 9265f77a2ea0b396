/* SPDX-License-Identifier: MIT */
/* For tests: cmocka with the headers that it needs, and for many random cases a generator of the tests' own
 * (xorshift64*, Vigna 2016). The cases then have nothing in common with the random numbers under test. */
#ifndef TESTS_COMMON_CASES_H
#define TESTS_COMMON_CASES_H

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

uint64_t case_u64(uint64_t *state);

/* Returns a number from lo to hi, both included. The bias of the remainder doesn't matter to a choice of cases. */
int64_t case_between(uint64_t *state, int64_t lo, int64_t hi);

/* Returns x with 0 <= x < 1. */
double case_unit(uint64_t *state);

#endif
