/* SPDX-License-Identifier: MIT */
/* A head with faults on request, and the truth about them in truth.json of the test's folder. */
#ifndef TESTS_WIRE_FAULT_HEAD_H
#define TESTS_WIRE_FAULT_HEAD_H

#include "tests/wire/room.h"

/* 30 lines of 1,000 pulses, cut by ticks: some 200 frames of the stream. */
extern const struct room_config FAULT_ROOM;

/* faults: the text of a scenario; NULL: none. more: further options, ends with NULL; or NULL. */
struct head fault_head_start(struct wire *wire, const struct room_config *c, const char *faults,
                             const char *const *more);
/* Adds one by a command; it is to have this number. */
void fault_head_add(struct scanhead *sh, const char *fault, const char *number);

#endif
