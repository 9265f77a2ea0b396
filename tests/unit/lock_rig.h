/* SPDX-License-Identifier: MIT */
/* Counts how often a call takes a lock, and how many it has left at its end. Two threads that meet without a lock
 * rarely show that, so a test counts. */
#ifndef TESTS_UNIT_LOCK_RIG_H
#define TESTS_UNIT_LOCK_RIG_H

/* The counts are those of the calling thread. */
extern _Thread_local int lock_rig_taken, lock_rig_held;

/* Fails where a call takes other than n locks, or has one left. */
#define TAKES(n, call)                                                                   \
    do {                                                                                 \
        lock_rig_taken = lock_rig_held = 0;                                              \
        (void)(call);                                                                    \
        if (lock_rig_taken != (n) || lock_rig_held != 0)                                 \
            fail_msg("%s: %d times, %d are held", #call, lock_rig_taken, lock_rig_held); \
    } while (0)

#endif
