/* SPDX-License-Identifier: MIT */
/* The stability table: a TAP comment line per regime with the naive method's figure, ours and the bound.
 *
 * A row fails where ours breaks the bound, and where the naive method keeps it: then the row proves nothing.
 */
#ifndef TESTS_STABILITY_TABLE_H
#define TESTS_STABILITY_TABLE_H

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

/* Column heads; once per program. */
void table_head(const char *title);
/* unit: "m", "ns", "rays" and so on; the same for all three figures. */
void table_row(const char *regime, const char *naive_method, double naive, double ours, double bound, const char *unit);
/* A line of words below a row. */
void table_note(const char *format, ...) __attribute__((format(printf, 1, 2)));
/* Fails the running test if a row since the last call failed: so that all rows are seen. */
void table_check(void);

#endif
