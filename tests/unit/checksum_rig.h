/* SPDX-License-Identifier: MIT */
/* Units whose contents are changed and whose checksums are made right again, for each protocol that has units. A reader
 * that follows the protocol's description alone must accept them. */
#ifndef TESTS_UNIT_CHECKSUM_RIG_H
#define TESTS_UNIT_CHECKSUM_RIG_H

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

#include "drivers/protocol/protocol.h"

/* Reads a unit, and asserts that its form and its checksums are right. Returns its contents, *size bytes. */
typedef const void *seal_reader(const uint8_t *unit, size_t len, size_t *size);

/* Returns how many bits of a unit may be changed. */
uint64_t seal_count(const struct protocol_ops *ops, const uint8_t *unit, size_t len);

/* Tries the unit's beginnings, each in memory of just its length, and the unit with random single bytes. Nothing
 * outside is read or written (sanitizers see that), and the changeable bits lie within it. */
void seal_check_broken(const struct protocol_ops *ops, const uint8_t *unit, size_t len);

/* Does that, and changes each of the changeable bits alone, and random sets of them. The reader must accept the unit,
 * with other contents. */
void seal_check(const struct protocol_ops *ops, const uint8_t *unit, size_t len, seal_reader *read);

#endif
