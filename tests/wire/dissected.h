/* SPDX-License-Identifier: MIT */
/* What tshark with drivers/protocol/wireshark/scanhead.lua says of a capture: each field as a queue of its values, in
 * the order of the stream. The test asks for them in that order, too; what is left over in the end was not expected. */
#ifndef TESTS_WIRE_DISSECTED_H
#define TESTS_WIRE_DISSECTED_H

#include "tests/wire/readers.h"

/* Runs tshark on a file in the test's folder, for these fields (ends with NULL); passes: 1 or 2. The queues are those of
 * the last run. Skips the test where tshark is not installed. */
void dissect(const char *file, int passes, const char *const *fields);
/* What tshark has written; good until the next run. */
const char *dissected_text(void);
/* How many values of a field there are, and how many were not asked for yet. */
size_t dissected_count(const char *field);
size_t dissected_left(const char *field);

/* The next value of a field. */
const char *take_text(const char *field);
void expect_text(const char *field, const char *value);
void expect_uint(const char *field, uint64_t value);
void expect_int(const char *field, int64_t value);
/* Of a time that Wireshark shows in seconds. */
void expect_ns(const char *field, int64_t ns);
/* tshark prints 15 digits: half a unit of the last one is up to 5e-15 of the value. error: what the value itself may
 * differ by, absolute. */
void expect_real(const char *field, double value, double error);
/* All of them were asked for. */
void expect_no_more(void);

#endif
