/* SPDX-License-Identifier: MIT */
#include "drivers/record/ptx_text.h"

#include <inttypes.h>
#include <stdio.h>
#include <string.h>

#include "core/decimal.h"

enum {
    LINE_MAX_LEN = 512,
    CELL_ROOM = 4 * DECIMAL_FIXED_ROOM + 3 * DECIMAL_WHOLE_ROOM,
    ROWS_AT_ONCE = 64,
    ROWS_BETWEEN_STOPS = 1 << 16,
};

static int put_vector(struct ptx_text *t, int digits, const double v[3], const char *end, struct sh_err *err)
{
    char text[LINE_MAX_LEN];
    int n = snprintf(text, sizeof text, "%.*f %.*f %.*f%s\n", digits, v[0], digits, v[1], digits, v[2], end);
    if (n >= (int)sizeof text) return outfile_fail_huge(t->file, v, err);
    return outfile_write(t->file, text, (size_t)n, err);
}

/* Vectors are rows in PTX. So the matrix has the transposed rotation, and the shift below it. */
static int put_header(struct ptx_text *t, struct sh_err *err)
{
    const struct ptx_grid *g = t->grid;
    const double *r = t->pose->rotation, *s = t->pose->shift_m;
    char size[64];
    int n = snprintf(size, sizeof size, "%" PRIu64 "\n%" PRIu64 "\n", (uint64_t)g->column_max - g->column_min + 1,
                     (uint64_t)g->row_max - g->row_min + 1);
    int rc = outfile_write(t->file, size, (size_t)n, err);
    if (rc == 0) rc = put_vector(t, 9, s, "", err);
    for (int i = 0; rc == 0 && i < 6; i++)
        rc = put_vector(t, 15, (const double[]){r[i % 3], r[3 + i % 3], r[6 + i % 3]}, i < 3 ? "" : " 0", err);
    return rc == 0 ? put_vector(t, 9, s, " 1", err) : rc;
}

/* Reports progress, as a large grid takes long. */
static void say_progress(struct ptx_text *t, uint32_t n_rows)
{
    char what[LINE_MAX_LEN];
    t->n_columns++;
    t->n_rows_unreported += n_rows;
    if (t->n_rows_unreported < ROWS_BETWEEN_STOPS) return;
    t->n_rows_unreported = 0;
    snprintf(what, sizeof what, "completing %s", t->file->path);
    sh_progress(t->report, what, (double)t->n_columns / ((double)t->grid->column_max - t->grid->column_min + 1));
}

const char ptx_text_empty[2][17] = {"0 0 0 0.5\n", "0 0 0 0.5 0 0 0\n"};

/* Returns the end of the line, which may be more than LINE_MAX_LEN away. */
static char *put_cell(char *to, const struct ptx_cell *c, int coloured)
{
    if (c->intensity < 0) {
        memcpy(to, ptx_text_empty[coloured != 0], sizeof ptx_text_empty[0]);
        return to + (coloured ? 16 : 10);
    }
    for (int i = 0; i < 3; i++) {
        to = decimal_put_fixed(to, c->p_socs[i], 6);
        *to++ = ' ';
    }
    to = decimal_put_fixed(to, (double)c->intensity, 6);
    for (int i = 0; i < 3 && coloured; i++) {
        *to++ = ' ';
        to = decimal_put_whole(to, c->rgb[i]);
    }
    *to++ = '\n';
    return to;
}

static int put_cells(struct ptx_text *t, const struct ptx_cell *cell, uint32_t n, struct sh_err *err)
{
    char *from = (char *)outfile_room(t->file, ROWS_AT_ONCE * CELL_ROOM, err), *to = from;
    int rc = from != NULL ? 0 : SH_EIO;
    for (uint32_t i = 0; rc == 0 && i < n; i++) {
        char *end = put_cell(to, &cell[i], t->coloured);
        if (end - to >= LINE_MAX_LEN) {
            rc = outfile_fail_huge(t->file, cell[i].p_socs, err);
            break;
        }
        to = end;
        t->n_points += cell[i].intensity >= 0;
    }
    if (from != NULL) outfile_used(t->file, (size_t)(to - from));
    return rc;
}

static int put_column(void *ctx, const struct ptx_cell *column, uint32_t n_rows, struct sh_err *err)
{
    struct ptx_text *t = ctx;
    int rc = outfile_check_stop(t->file, t->report, err);
    say_progress(t, n_rows);
    for (uint32_t i = 0; rc == 0 && i < n_rows; i += ROWS_AT_ONCE) {
        if (i > 0 && i % ROWS_BETWEEN_STOPS == 0) rc = outfile_check_stop(t->file, t->report, err);
        if (rc == 0) rc = put_cells(t, column + i, n_rows - i < ROWS_AT_ONCE ? n_rows - i : ROWS_AT_ONCE, err);
    }
    return rc;
}

int ptx_text_put(struct ptx_text *t, struct sh_err *err)
{
    const int rc = put_header(t, err);
    return rc != 0 ? rc : ptx_grid_drain(t->grid, put_column, t, err);
}
