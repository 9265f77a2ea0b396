/* SPDX-License-Identifier: MIT */
/* Each field of each frame type as tshark has it, beside what libscanhead says of the same frame. */
#ifndef TESTS_WIRE_DISSECTED_FRAMES_H
#define TESTS_WIRE_DISSECTED_FRAMES_H

#include "tests/wire/wireshark_rig.h"

/* Ends with NULL. */
extern const char *const all_fields[];

/* Takes all values of the frames in a file of the test's folder, and fails where one differs. Returns the types that
 * there were, as bits. */
unsigned expect_stream(const char *name);

#endif
