/* SPDX-License-Identifier: MIT */
/* A head with faults on request, and the truth about them in truth.json of the test's folder. */
#ifndef TESTS_WIRE_FAULT_HEAD_H
#define TESTS_WIRE_FAULT_HEAD_H

#include "tests/wire/room.h"

/* 30 lines of 1,000 pulses, cut by ticks, make some 200 frames of the stream. */
extern const struct room_config FAULT_ROOM;

/* Starts a head. `faults` is the text of a scenario; NULL: none. `more` has further options and ends with NULL, or is
 * NULL. */
struct head fault_head_start(struct wire *wire, const struct room_config *c, const char *faults,
                             const char *const *more);
/* Adds a fault by a command. The head must give it this number. */
void fault_head_add(struct scanhead *sh, const char *fault, const char *number);

#endif
