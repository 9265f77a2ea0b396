/* SPDX-License-Identifier: MIT */
/* Repair of PTX files. Whole grids are in FILE.part as text. The grid of the scan that was not over is in FILE.grid
 * (ptx_grid.h). The grid's text is made now, as the recorder would have made it, and replaces any text of this grid
 * that the recorder had begun. FILE.grid is removed last, so that a repair that is killed can begin again.
 *
 * Without a FILE.grid, for instance when FILE.part was copied alone, the points of the last grid are kept all the same:
 * its last column is filled up with shots without echo, and its header gets the number of columns that are there.
 * Spaces after that number keep the line's length.
 *
 * The format has no place for the mark of a program. So only a file named .part is changed; any other one may be
 * another program's, and is only checked. */
#include <errno.h>
#include <inttypes.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "core/infile.h"
#include "drivers/record/ptx_text.h"
#include "drivers/record/repair.h"

enum { LINE_MOST = 512, HEADER_LINES = 10 };
static const uint64_t MOST = UINT32_MAX; /* columns, rows */

/* How far the text has been read, in grids. */
struct place {
    uint64_t at, grid_at;            /* bytes: where the last line ends, and where the grid begins */
    uint64_t columns, rows, n_lines; /* of the grid; lines that were there */
    uint64_t n_points;               /* of all */
    uint64_t n_grids;                /* that are whole */
    size_t columns_len;              /* of the grid's first line */
    int header;                      /* lines of the grid's header that were there */
    int coloured;                    /* the last point had a colour */
};

/* Counts the numbers in a line; 0: there is something else. Spaces may follow them. */
static int count_numbers(const char *line, size_t len)
{
    int n = 0;
    while (len > 0 && (line[len - 1] == ' ' || line[len - 1] == '\r'))
        len--;
    for (size_t i = 0; i < len; i++) {
        if (strchr("0123456789+-.eE ", line[i]) == NULL) return 0;
        n += line[i] != ' ' && (i == 0 || line[i - 1] == ' ');
    }
    return n;
}

static int take_size(const char *line, uint64_t *v)
{
    char *end;
    *v = strtoull(line, &end, 10);
    return end > line && *v > 0 && *v <= MOST;
}

static int take_header(struct place *p, const char *line, size_t len)
{
    const int n = count_numbers(line, len);
    if (p->header == 0) {
        p->grid_at = p->at;
        p->n_lines = 0;
        p->columns_len = len;
        return n == 1 && take_size(line, &p->columns);
    }
    if (p->header == 1) return n == 1 && take_size(line, &p->rows);
    return n == (p->header < 6 ? 3 : 4);
}

static int take_point(struct place *p, const char *line, size_t len)
{
    const int n = count_numbers(line, len);
    if (n != 4 && n != 7) return 0;
    p->coloured = n == 7;
    p->n_points += strncmp(line, "0 0 0 ", 6) != 0;
    p->n_lines++;
    return 1;
}

static int ptx_repair_take_line(void *ctx, const char *line, size_t len)
{
    struct place *p = ctx;
    if (len >= LINE_MOST || !(p->header < HEADER_LINES ? take_header(p, line, len) : take_point(p, line, len)))
        return 0;
    p->header += p->header < HEADER_LINES;
    p->at += len + 1;
    if (p->header == HEADER_LINES && p->n_lines == p->columns * p->rows) {
        p->n_grids++;
        p->header = 0;
    }
    return 1;
}

/* Reads the first `len` bytes. */
static int read_text(const struct repair *r, uint64_t len, struct place *p, struct sh_err *err)
{
    struct repair front = *r;
    uint64_t end;
    front.len = len;
    memset(p, 0, sizeof *p);
    const int rc = repair_lines(&front, 0, ptx_repair_take_line, p, &end, err);
    return rc == SH_OK ? repair_check_rest(&front, end, LINE_MOST, err) : rc;
}

/* Ends the file after the last write. rc is that of the writes before. */
static int end_file(const struct repair *r, struct outfile *file, int rc, struct sh_err *err)
{
    if (rc == SH_OK) rc = outfile_flush(file, err);
    const uint64_t end = file->written;
    outfile_leave(file);
    if (rc == SH_OK && ftruncate(r->fd, (off_t)end) != 0)
        rc = sh_fail(err, SH_EIO, "%s: cannot be cut: %s", r->path, strerror(errno));
    if (rc != SH_OK || fdatasync(r->fd) == 0) return rc;
    return sh_fail(err, SH_EIO, "%s: cannot be synced: %s", r->path, strerror(errno));
}

/* ---- the last grid has no file */

static int fill_column(const struct repair *r, const struct place *p, uint64_t n, struct sh_err *err)
{
    const char *line = ptx_text_empty[p->coloured];
    struct outfile file;
    int rc = outfile_over(&file, r->fd, r->path, p->at, err);
    if (rc != SH_OK) return rc;
    for (uint64_t i = 0; rc == SH_OK && i < n; i++)
        rc = outfile_write(&file, line, strlen(line), err);
    return end_file(r, &file, rc, err);
}

static int set_columns(const struct repair *r, const struct place *p, uint64_t columns, struct sh_err *err)
{
    char text[32];
    const int len = (int)p->columns_len, n = snprintf(text, sizeof text, "%-*" PRIu64, len, columns);
    if (n != len)
        return sh_fail(err, SH_EFORMAT,
                       "%s: the field of the number of columns at byte %" PRIu64 " is too short for %" PRIu64, r->path,
                       p->grid_at, columns);
    return repair_write(r, p->grid_at, text, (size_t)n, err);
}

/* Checks that the file may be changed. */
static int check_ours(const struct repair *r, const struct place *p, struct sh_err *err)
{
    if (!repair_is_part(r))
        return sh_fail(
            err, SH_EFORMAT,
            "%s: is incomplete or has more than its grids, and it has no mark of scanhead; only .part files are "
            "changed: rename it to %s.part if scanhead wrote it",
            r->path, r->path);
    if (p->header < HEADER_LINES || p->rows <= PTX_ROWS_MAX) return SH_OK;
    return sh_fail(err, SH_EFORMAT, "%s: the grid at byte %" PRIu64 " has %" PRIu64 " rows; a recorder writes up to %d",
                   r->path, p->grid_at, p->rows, PTX_ROWS_MAX);
}

static int end_text(struct repair *r, struct place *p, struct sh_err *err)
{
    int rc = read_text(r, r->len, p, err);
    if (rc != SH_OK) return rc;
    if (p->n_grids == 0 && p->n_lines == 0) return repair_fail_none(r, "PTX grid", err);
    if (r->len > p->at || p->header > 0) {
        rc = check_ours(r, p, err);
        if (rc != SH_OK) return rc;
    }
    if (p->header < HEADER_LINES || p->n_lines == 0) { /* no point of this grid is there */
        const uint64_t end = p->header > 0 ? p->grid_at : p->at;
        r->was_whole = end == r->len;
        return repair_cut(r, end, err);
    }
    const uint64_t columns = (p->n_lines + p->rows - 1) / p->rows;
    r->cut_bytes = r->len - p->at;
    rc = fill_column(r, p, columns * p->rows - p->n_lines, err);
    if (rc == SH_OK) rc = set_columns(r, p, columns, err);
    p->n_grids++;
    return rc;
}

/* ---- the last grid has a file */

/* Writes the grid's text, from head->text_at on. */
static int put_grid(struct repair *r, struct ptx_grid *grid, const struct ptx_head *head, struct place *p,
                    struct sh_err *err)
{
    struct outfile file;
    struct ptx_text text = {
        .file = &file, .grid = grid, .pose = &head->pose, .coloured = head->coloured != 0, .report = r->report};
    int rc = outfile_over(&file, r->fd, r->path, head->text_at, err);
    if (rc != SH_OK) return rc;
    rc = end_file(r, &file, ptx_text_put(&text, err), err);
    p->n_points += text.n_points;
    p->n_grids++;
    if (rc != SH_EIO) return rc;
    return sh_fail(
        err, rc,
        "%s: cannot be written together with the grid in %s: the grid's text needs as much room again on the disk; "
        "nothing is lost: free some room and repeat the command",
        r->path, grid->path);
}

static int end_grid(struct repair *r, struct ptx_grid *grid, const struct ptx_head *head, struct place *p,
                    struct sh_err *err)
{
    const int rc = head->text_at <= r->len ? read_text(r, head->text_at, p, err) : SH_OK;
    if (rc != SH_OK) return rc;
    if (head->text_at > r->len || p->at != head->text_at || p->header != 0)
        return sh_fail(err, SH_EFORMAT, "%s: continues a PTX file from byte %" PRIu64 ", but in %s no grid ends there",
                       grid->path, head->text_at, r->path);
    if (grid->row_max - grid->row_min >= PTX_ROWS_MAX)
        return sh_fail(err, SH_EFORMAT, "%s: has rows %u to %u; allowed are up to %d rows", grid->path, grid->row_min,
                       grid->row_max, PTX_ROWS_MAX);
    return put_grid(r, grid, head, p, err);
}

/* Opens FILE.grid. SH_OK also where there is none: spool is NULL then. */
static int open_grid(const struct repair *r, struct ptx_grid *grid, struct sh_err *err)
{
    memset(grid, 0, sizeof *grid);
    if (!repair_is_part(r)) return SH_OK;
    if (asprintf(&grid->path, "%.*s.grid", (int)(strlen(r->path) - strlen(".part")), r->path) < 0) {
        grid->path = NULL;
        return sh_fail(err, SH_ENOMEM, "%s: no memory to repair it", r->path);
    }
    const char *why;
    grid->spool = infile_open(grid->path, &why);
    if (grid->spool != NULL || access(grid->path, F_OK) != 0) return SH_OK;
    return sh_fail(err, SH_EIO, "%s: cannot be read: %s", grid->path, why);
}

int ptx_repair(struct repair *r, struct sh_err *err)
{
    struct ptx_grid grid;
    struct place place = {0};
    struct ptx_head head;
    uint64_t cut = 0;
    int rc = open_grid(r, &grid, err);
    if (rc == SH_OK && grid.spool != NULL) rc = ptx_grid_find(&grid, &head, &cut, err);
    if (rc > 0) {
        r->cut_bytes = cut;
        rc = end_grid(r, &grid, &head, &place, err);
    } else if (rc == SH_OK) {
        rc = end_text(r, &place, err); /* there is no grid, so the text is all that is left */
    }
    if (rc == SH_OK && grid.spool != NULL) unlink(grid.path);
    repair_say_kept(r, "points", place.n_points, place.n_grids);
    if (grid.spool != NULL) fclose(grid.spool);
    free(grid.path);
    return rc;
}
