/* SPDX-License-Identifier: MIT */
/* Benches stay on one processor: what a round finds in the caches is its own. */
#ifndef TESTS_BENCH_PIN_H
#define TESTS_BENCH_PIN_H

#include <sched.h>

/* The calling thread to the processor it runs on. before: what unpin restores; NULL: nobody asks. */
void pin(cpu_set_t *before);
void unpin(const cpu_set_t *before);

#endif
