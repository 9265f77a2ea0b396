/* SPDX-License-Identifier: MIT */
/* The machine's clock in the hand of a test: it replaces firmware_sim/base/clock.c. Time goes on only where the test
 * says so, and by sleeps, which end at once. */
#ifndef TESTS_UNIT_CLOCK_RIG_H
#define TESTS_UNIT_CLOCK_RIG_H

#include <stdint.h>

extern int64_t clock_rig_ns;
extern double clock_rig_cpu_s;    /* what clock_cpu_s says */
extern int64_t clock_rig_each_ns; /* each reading lets so much time pass after it; 0 at first */

#endif
