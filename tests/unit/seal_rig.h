/* SPDX-License-Identifier: MIT */
/* Units whose content is changed and whose checksums are made right again, for each protocol that has units: what a
 * reader that knows the protocol's description alone makes of them. */
#ifndef TESTS_UNIT_SEAL_RIG_H
#define TESTS_UNIT_SEAL_RIG_H

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

#include "drivers/protocol/protocol.h"

/* Reads a unit, and asserts that its form and its checksums are right. Returns what it says, *size bytes. */
typedef const void *seal_reader(const uint8_t *unit, size_t len, size_t *size);

/* Bits of a unit that may be changed. */
uint64_t seal_count(const struct protocol_ops *ops, const uint8_t *unit, size_t len);

/* Each of these bits alone, and random sets of them: the reader accepts the unit, and it says something else. */
void seal_check(const struct protocol_ops *ops, const uint8_t *unit, size_t len, seal_reader *read);

/* Its beginnings, each in memory of just its length, and the unit with single bytes that are anything: nothing beside
 * it is read or written (sanitizers see that), and what may change lies within it. */
void seal_check_broken(const struct protocol_ops *ops, const uint8_t *unit, size_t len);

#endif
