/* Benches stay on one processor: what a round finds in the caches is its own. */
#ifndef TESTS_BENCH_PIN_H
#define TESTS_BENCH_PIN_H

#include <sched.h>

static inline void pin(void)
{
    cpu_set_t one;
    int cpu = sched_getcpu();
    CPU_ZERO(&one);
    CPU_SET(cpu < 0 ? 0U : (unsigned)cpu, &one);
    sched_setaffinity(0, sizeof one, &one);
}

#endif
