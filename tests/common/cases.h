/* SPDX-License-Identifier: MIT */
/* For tests with many random cases: cmocka, and a generator of its own kind (xorshift64*, Vigna 2016), so
 * that the cases have nothing in common with the numbers under test. */
#ifndef TESTS_COMMON_CASES_H
#define TESTS_COMMON_CASES_H

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

uint64_t case_u64(uint64_t *state);

/* lo..hi, both included. The bias of the remainder doesn't matter to a choice of cases. */
int64_t case_between(uint64_t *state, int64_t lo, int64_t hi);

/* 0 <= x < 1. */
double case_unit(uint64_t *state);

#endif
