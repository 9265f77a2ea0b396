/* SPDX-License-Identifier: MIT */
/* The run of a soak, alone: the head, the clean reader, the clients and the results are the test's. They write each
 * call to `trace`, with the time in ms. Each wait takes 20 ms. Words in capitals stand for a call that is not as it
 * should be. */
#ifndef TESTS_UNIT_SOAK_RUN_RIG_H
#define TESTS_UNIT_SOAK_RUN_RIG_H

#include "tests/unit/trace_rig.h"

enum { NOT_EVER = 1000000000 };

/* When, in ms: the head scans; all clients are done; they have seen the head's faults; the clean reader answers, or
 * fails. */
struct times {
    int scans, done, seen, answers, breaks;
};

extern struct times when;
extern int is_bad; /* the verdict */

/* For cmocka: the time is 0, and points come from 40 ms on. */
int make_soak_run(void **state);

#endif
