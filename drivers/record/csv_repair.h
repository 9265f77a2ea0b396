/* SPDX-License-Identifier: MIT */
/* This is the repair (repair.h) of CSV files whose first column is the scan's number. Rows are kept up to the last
 * whole one. Lines of comment begin with #. */
#ifndef DRIVERS_RECORD_CSV_REPAIR_H
#define DRIVERS_RECORD_CSV_REPAIR_H

#include "drivers/record/repair.h"

struct csv_format {
    const char *const *title; /* the first line, one of these, with its newline; NULL at the end */
    const char *letters;      /* the characters that a row may have */
    const char *unit, *what;  /* "poses", "file of poses" */
    size_t line_most;         /* bytes of a row */
};

int csv_repair(struct repair *repair, const struct csv_format *format, struct sh_err *err);

#endif
