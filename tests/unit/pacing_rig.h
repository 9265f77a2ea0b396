/* SPDX-License-Identifier: MIT */
/* Finds what the pacing thread must not do. Functions that allocate, lock or print are replaced by ones that look who
 * calls them. A filter of the kernel's (seccomp) shows every system call of the thread but those that it needs: to sleep by
 * the clock, to read it, the futexes of semaphores, and wake-ups: 8 bytes to an eventfd.
 *
 * The thread is armed by its first sleep by the clock: no other thread sleeps so. It stays armed until it ends. */
#ifndef TESTS_UNIT_PACING_RIG_H
#define TESTS_UNIT_PACING_RIG_H

#include "tests/unit/device_rig.h"

#include "firmware_sim/loop/loop.h"

#ifndef SH_SANITIZE /* which has an allocator and locks of its own */

/* Before a loop starts: nothing is found yet. planted: called by the pacing thread before each of its sleeps, with their
 * number from 0; NULL: nothing is planted. */
void pacing_watch(void (*planted)(int sleep));
/* After loop_join. Returns how many forbidden calls there were, and prints each kind. */
int pacing_found(void);
/* Whether a call of that name, or with `system call N` that system call, is among them. */
int pacing_has(const char *name);
/* From now on each mutex takes other threads so long; 0: no longer than it does. Any thread. */
void pacing_slow_locks(int64_t ns);
/* Sleeps so far. */
int pacing_sleeps(void);
/* 0: the kernel has no such filter. Before pacing_watch. */
int pacing_filter_works(void);

#endif
#endif
