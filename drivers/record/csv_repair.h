/* SPDX-License-Identifier: MIT */
/* CSV files whose first column is the scan's number: their title, and their repair (repair.h). Rows are kept up to the
 * last whole one. Lines of comment begin with #. */
#ifndef DRIVERS_RECORD_CSV_REPAIR_H
#define DRIVERS_RECORD_CSV_REPAIR_H

#include "drivers/record/outfile.h"
#include "drivers/record/repair.h"

struct csv_format {
    const char *const *title; /* the first line, one of these, with its newline; NULL at the end */
    const char *letters;      /* the characters that a row may have */
    const char *unit, *what;  /* "poses", "file of poses" */
    size_t line_most;         /* bytes of a row */
};

/* Writes the title, which the file begins with, unless it is there. */
int csv_put_title(struct outfile *file, const char *title, struct sh_err *err);

int csv_repair(struct repair *repair, const struct csv_format *format, struct sh_err *err);

#endif
