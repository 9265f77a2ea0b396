/* SPDX-License-Identifier: MIT */
/* This gives the real program wrong input, for the tests of its answers. */
#ifndef TESTS_WIRE_USAGE_RIG_H
#define TESTS_WIRE_USAGE_RIG_H

#include "tests/wire/wire.h"

/* A configuration that runs, with room.obj in its folder. */
extern const char USAGE_GOOD[];

/* Counts the wrong answers, so that all are reported and not only the first. */
extern int usage_complaints;

#define usage_complain(...) (usage_complaints++, print_message(__VA_ARGS__), print_message("\n"))

/* Runs the program. The program's status must be `status`, and its one line of error must have all of `says` (ends with
 * NULL). */
void usage_expect(struct wire *wire, const char *what, const char *const *args, int status, const char *const *says);

/* The words of a command line with blanks between them, for wire_spawn; @ is the folder. The words are good until the
 * next call. */
const char *const *usage_words(const struct wire *wire, const char *line);

#endif
