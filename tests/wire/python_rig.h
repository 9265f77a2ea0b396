/* SPDX-License-Identifier: MIT */
/* The client in Python, run with what a test asks of it, and recordings for it to read. */
#ifndef TESTS_WIRE_PYTHON_RIG_H
#define TESTS_WIRE_PYTHON_RIG_H

#include "tests/wire/room.h"

extern const char python[]; /* Debian's, for which its numpy is made */

extern const char *const flavours[2]; /* with numpy, and without */

extern const struct room_config SMALL, RIDE; /* a head that stands, and one on the way of write_ride */

int setup(void **state);

/* Skips the test where Python is missing. */
void need_python(void);

/* Runs python_client.py. Returns its output, which is good until the next call, or NULL where numpy is wanted and
 * missing. */
const char *ask_python(struct wire *wire, const char *flavour, const char *what, const char *a, const char *b);

/* Records one station off line, with these keys set. Returns the file's path. */
const char *record(struct wire *wire, const struct room_config *c, const char *name, const char *keys);

/* Writes ride.csv, the trajectory of RIDE. */
void write_ride(const struct wire *wire);

#endif
