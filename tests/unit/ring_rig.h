/* SPDX-License-Identifier: MIT */
/* For tests of the ring: a small one, made anew for each test. */
#ifndef TESTS_UNIT_RING_RIG_H
#define TESTS_UNIT_RING_RIG_H

#include "firmware_sim/loop/ring.h"

enum { AHEAD = 6, QUEUE = 4, SPARE = 4, SLOT_BYTES = 1000 };
extern const struct ring_size SIZE;
extern struct ring ring;

int open_ring(void **state);
int close_ring(void **state);

#endif
