/* SPDX-License-Identifier: MIT */
/* These are the fields of each frame type by tshark, beside libscanhead's values of the same frame. */
#ifndef TESTS_WIRE_DISSECTED_FRAMES_H
#define TESTS_WIRE_DISSECTED_FRAMES_H

#include "tests/wire/dissected_fields.h"
#include "tests/wire/wireshark_rig.h"

/* Takes all values of the frames in a file of the test's folder, and fails where one differs. Returns the types of the
 * frames, as bits. */
unsigned expect_stream(const char *name);

#endif
