/* SPDX-License-Identifier: MIT */
/* The output of tshark with drivers/protocol/wireshark/scanhead.lua for a capture. Each field is a queue of its values,
 * in the order of the stream, and the test takes them in that order. Values that are left over at the end are
 * unexpected. */
#ifndef TESTS_WIRE_DISSECTED_H
#define TESTS_WIRE_DISSECTED_H

#include "tests/wire/readers.h"

/* Runs tshark on a file in the test's folder, for these fields (ends with NULL); passes: 1 or 2. The queues are those
 * of the last run. Skips the test where tshark is not installed. */
void dissect(const char *file, int passes, const char *const *fields);
/* Returns the output of tshark, which is good until the next run. */
const char *dissected_text(void);
/* Returns how many values a field has, and how many of them were not taken yet. */
size_t dissected_count(const char *field);
size_t dissected_left(const char *field);

/* Takes the next value of a field. */
const char *take_text(const char *field);
void expect_text(const char *field, const char *value);
void expect_uint(const char *field, uint64_t value);
void expect_int(const char *field, int64_t value);
/* Takes a time that Wireshark shows in seconds. */
void expect_ns(const char *field, int64_t ns);
/* tshark prints 15 digits: half a unit of the last one is up to 5e-15 of the value. `error` is the absolute error that
 * the value itself may have. */
void expect_real(const char *field, double value, double error);
/* All values have been taken. */
void expect_no_more(void);

#endif
