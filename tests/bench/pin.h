/* SPDX-License-Identifier: MIT */
/* Benches stay on one processor, so that a round finds only its own data in the caches. */
#ifndef TESTS_BENCH_PIN_H
#define TESTS_BENCH_PIN_H

#include <sched.h>

/* Binds the calling thread to the processor it runs on. before receives what unpin restores, and may be NULL. */
void pin(cpu_set_t *before);
void unpin(const cpu_set_t *before);

#endif
