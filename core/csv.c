/* SPDX-License-Identifier: MIT */
#include "core/csv.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { CELL_LEN = 64 };

/* The next line that counts, without blanks at its ends; empty at the end of the file. */
static struct text_span next_line(struct csv *csv)
{
    struct text *t = &csv->text;
    while (t->p < t->end) {
        csv->line = t->line;
        struct text_span line = text_rest(t);
        text_next_line(t);
        if (line.n != 0 && line.p[0] != '#') return line;
    }
    return (struct text_span){NULL, 0};
}

/* The next cell, NUL-terminated; 0: there is none; -1: too long. */
static int next_cell(const char **p, const char *end, char cell[CELL_LEN])
{
    if (*p > end) return 0;
    const char *comma = memchr(*p, ',', (size_t)(end - *p)), *to = comma != NULL ? comma : end, *from = *p;
    *p = to + 1;
    while (from < to && (*from == ' ' || *from == '\t'))
        from++;
    while (to > from && (to[-1] == ' ' || to[-1] == '\t'))
        to--;
    if (to - from >= CELL_LEN) return -1;
    memcpy(cell, from, (size_t)(to - from));
    cell[to - from] = '\0';
    for (char *c = cell; c < cell + (to - from); c++)
        if (*c == '\0') *c = '?'; /* else the rest of the cell would not be read */
    return 1;
}

static int fail_name(const struct csv *csv, const char *name, const char *what, struct sh_err *err)
{
    char allowed[200] = "";
    for (int i = 0; csv->known[i] != NULL; i++)
        snprintf(allowed + strlen(allowed), sizeof allowed - strlen(allowed), "%s%s", i > 0 ? ", " : "", csv->known[i]);
    return text_fail(&csv->text, csv->line, SH_EINPUT, err, "column \"%s\" %s; allowed %s", name, what, allowed);
}

static int read_names(struct csv *csv, struct sh_err *err)
{
    char cell[CELL_LEN];
    struct text_span line = next_line(csv);
    const char *p = line.p;
    if (line.n == 0) return text_fail(&csv->text, 0, SH_EINPUT, err, "empty; the first line must name the columns");
    for (int got; (got = next_cell(&p, line.p + line.n, cell)) != 0;) {
        int k = 0;
        if (got < 0) return text_fail(&csv->text, csv->line, SH_EINPUT, err, "a column's name is too long");
        while (csv->known[k] != NULL && strcmp(csv->known[k], cell) != 0)
            k++;
        if (csv->known[k] == NULL) return fail_name(csv, cell, "is unknown", err);
        if (csv->has & 1u << k) return fail_name(csv, cell, "is there twice", err);
        csv->has |= 1u << k;
        csv->column[csv->n_columns++] = k;
    }
    return SH_OK;
}

static int csv_heed_stop(void *csv, double fraction, struct sh_err *err)
{
    (void)fraction;
    return sh_check_stop(((const struct csv *)csv)->report, err);
}

int csv_open(struct csv *csv, const char *path, const char *const *known, const struct sh_report *report,
             struct sh_err *err)
{
    memset(csv, 0, sizeof *csv);
    csv->known = known;
    csv->report = report;
    int rc = text_open(&csv->text, path, csv_heed_stop, csv, err);
    return rc == SH_OK ? read_names(csv, err) : rc;
}

void csv_close(struct csv *csv)
{
    text_close(&csv->text);
}

static int read_number(const struct csv *csv, const char *cell, double *value)
{
    char *end;
    *value = strtod_l(cell, &end, csv->text.c_locale);
    return cell[0] != '\0' && *end == '\0' && strpbrk(cell, "xXnN") == NULL && isfinite(*value);
}

int csv_next(struct csv *csv, struct sh_err *err)
{
    char cell[CELL_LEN];
    struct text_span line = next_line(csv);
    const char *p = line.p;
    if (line.n == 0) return 0;
    if ((csv->line & 0xfff) == 0 && sh_check_stop(csv->report, err) != SH_OK) return SH_ESTOPPED;
    int n = 0;
    for (int got; (got = next_cell(&p, line.p + line.n, cell)) != 0; n++) {
        if (n == csv->n_columns)
            return text_fail(&csv->text, csv->line, SH_EINPUT, err, "more than the %d values that the first line names",
                             csv->n_columns);
        if (got < 0 || !read_number(csv, cell, &csv->value[csv->column[n]]))
            return text_fail(&csv->text, csv->line, SH_EINPUT, err, "%s is not a finite decimal number: \"%s\"",
                             csv->known[csv->column[n]], got < 0 ? "..." : cell);
    }
    if (n < csv->n_columns)
        return text_fail(&csv->text, csv->line, SH_EINPUT, err, "%d values, but the first line names %d", n,
                         csv->n_columns);
    return 1;
}
