/* SPDX-License-Identifier: MIT */
/* The stability table: a TAP comment line per regime with the naive method's figure, ours and the bound.
 *
 * A row fails where ours breaks the bound. It also fails where the naive method keeps it, as the row then proves
 * nothing. */
#ifndef TESTS_STABILITY_TABLE_H
#define TESTS_STABILITY_TABLE_H

#include "tests/common/cases.h"

/* Prints the column heads; call it once per program. */
void table_head(const char *title);
/* `unit` is "m", "ns", "rays" and so on, the same for all three figures. */
void table_row(const char *regime, const char *naive_method, double naive, double ours, double bound, const char *unit);
/* Prints a line of words below a row. */
void table_note(const char *format, ...) __attribute__((format(printf, 1, 2)));
/* Fails the running test if a row has failed since the last call. That way all rows are printed. */
void table_check(void);

#endif
