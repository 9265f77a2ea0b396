/* SPDX-License-Identifier: MIT */
/* Finds forbidden calls of the pacing thread. Functions that allocate, lock or print are replaced by ones that note the
 * calls of this thread. A filter of the kernel's (seccomp) shows every system call of the thread but those that it
 * needs: to sleep by the clock, to read it, the futexes of semaphores, and wake-ups, which are 8 bytes to an eventfd.
 *
 * The thread is armed by its first sleep by the clock, as no other thread sleeps so. The armed thread stays so until it
 * ends. */
#ifndef TESTS_UNIT_PACING_RIG_H
#define TESTS_UNIT_PACING_RIG_H

#include "tests/unit/device_rig.h"

#include "firmware_sim/loop/loop.h"

#ifndef SH_SANITIZE /* which has an allocator and locks of its own */

/* Call it before a loop starts: it forgets all findings. planted: called by the pacing thread before each of its
 * sleeps, with their number from 0; NULL: nothing is planted. */
void pacing_watch(void (*planted)(int sleep));
/* Call it after loop_join. Returns how many forbidden calls there were, and prints the first 20. */
int pacing_found(void);
/* Returns whether a call of that name, or with `system call N` that system call, is among them. */
int pacing_has(const char *name);
/* From now on other threads wait for so long before they lock a mutex; 0: not at all. Any thread may call it. */
void pacing_slow_locks(int64_t ns);
/* Returns the number of sleeps so far. */
int pacing_sleeps(void);
/* Returns 0 where the kernel has no such filter. Call it before pacing_watch. */
int pacing_filter_works(void);

#endif
#endif
