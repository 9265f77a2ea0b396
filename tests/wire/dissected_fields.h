/* SPDX-License-Identifier: MIT */
/* The fields of the dissector that the tests compare. */
#ifndef TESTS_WIRE_DISSECTED_FIELDS_H
#define TESTS_WIRE_DISSECTED_FIELDS_H

/* Ends with NULL. */
extern const char *const all_fields[];

#endif
