/* SPDX-License-Identifier: MIT */
/* A CSV file of numbers whose first line names the columns. In: a path, the names that are known. Out: the numbers by
 * column, line by line. Empty lines, and those that begin with a number sign, do not count. Not real-time safe. */
#ifndef CORE_CSV_H
#define CORE_CSV_H

#include "core/text.h"

enum { CSV_MAX_COLUMNS = 16 };

struct csv {
    struct text text;
    const char *const *known;    /* names of columns, NULL at the end; value[k] belongs to known[k] */
    int column[CSV_MAX_COLUMNS]; /* for each column of the file its index in known */
    int n_columns;
    uint32_t has;                  /* bit k: the file has known[k] */
    double value[CSV_MAX_COLUMNS]; /* of the line read last; 0 where the file has no such column */
    uint64_t line;                 /* number of that line, from 1 */
    const struct sh_report *report;
};

/* Reads the header; csv_close is due in any case. Unknown or doubled names are errors. csv_open and csv_next return
 * SH_ESTOPPED where report asks to stop. */
int csv_open(struct csv *csv, const char *path, const char *const *known, const struct sh_report *report,
             struct sh_err *err);
void csv_close(struct csv *csv);
/* 1: a line is in value; 0: the end; or a negative error. */
int csv_next(struct csv *csv, struct sh_err *err);

#endif
