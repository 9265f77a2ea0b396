/* SPDX-License-Identifier: MIT */
#include "drivers/record/csv_repair.h"

#include <stdlib.h>
#include <string.h>

int csv_put_title(struct outfile *file, const char *title, struct sh_err *err)
{
    return file->written + file->len > 0 ? SH_OK : outfile_write(file, title, strlen(title), err);
}

struct rows {
    const struct csv_format *format;
    int titled, n_columns;
    int is_marked; /* the last line says that the file is incomplete */
    long scan;     /* of the last row */
    uint64_t n, n_scans;
};

static int count_columns(const char *line)
{
    int n = 1;
    for (; *line != '\0'; line++)
        n += *line == ',';
    return n;
}

static int take_title(struct rows *rows, const char *line, size_t len)
{
    for (const char *const *title = rows->format->title; *title != NULL; title++)
        rows->titled |= strlen(*title) == len + 1 && memcmp(*title, line, len) == 0;
    rows->n_columns = count_columns(line);
    return rows->titled;
}

static int take_row(void *ctx, const char *line, size_t len)
{
    struct rows *rows = ctx;
    if (!rows->titled) return take_title(rows, line, len);
    rows->is_marked = repair_is_mark(line, len);
    if (line[0] == '#') return 1;
    if (strspn(line, rows->format->letters) != len || count_columns(line) != rows->n_columns) return 0;
    const long scan = strtol(line, NULL, 10);
    rows->n_scans += (uint64_t)(rows->n == 0 || scan != rows->scan);
    rows->scan = scan;
    rows->n++;
    return 1;
}

int csv_repair(struct repair *r, const struct csv_format *format, struct sh_err *err)
{
    struct rows rows = {.format = format};
    uint64_t end;
    int rc = repair_lines(r, 0, take_row, &rows, &end, err);
    if (rc == SH_OK && !rows.titled) rc = repair_fail_none(r, format->what, err);
    if (rc == SH_OK) rc = repair_check_rest(r, end, format->line_most, err);
    if (rc != SH_OK) return rc;
    repair_say_kept(r, format->unit, rows.n, rows.n_scans);
    return repair_end_text(r, end, rows.is_marked, 1, err);
}
