/* SPDX-License-Identifier: MIT */
#include "drivers/record/ptx_grid.h"

#include <errno.h>
#include <inttypes.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "core/newfile.h"
#include "drivers/protocol/crc32c.h"

enum { CELLS_AT_ONCE = 256, SPOOL_BUFFER = 1 << 18 };

static const char MAGIC[8] = "ptxgrid1";

static int fail_spool(const struct ptx_grid *grid, struct sh_err *err)
{
    return sh_fail(err, SH_EIO, "%s: cannot write: %s", grid->path, strerror(errno));
}

static int fail_read(const struct ptx_grid *grid, struct sh_err *err)
{
    return sh_fail(err, SH_EIO, "%s: cannot be read back: %s", grid->path,
                   ferror(grid->spool) ? strerror(errno) : "it became shorter");
}

/* After a failure nothing more is written, so that what is there stays in one piece. */
static int ptx_grid_put(struct ptx_grid *grid, const void *data, size_t len, struct sh_err *err)
{
    if (!ferror(grid->spool) && fwrite(data, len, 1, grid->spool) == 1) return 0;
    return fail_spool(grid, err);
}

int ptx_grid_open(struct ptx_grid *grid, const char *path, struct sh_err *err)
{
    memset(grid, 0, sizeof *grid);
    grid->is_empty = 1;
    if (asprintf(&grid->path, "%s.grid", path) < 0) grid->path = NULL;
    if (asprintf(&grid->part, "%s.part", path) < 0) grid->part = NULL;
    int fd, rc = SH_OK;
    if (grid->path == NULL || grid->part == NULL)
        rc = sh_fail(err, SH_ENOMEM, "%s: no memory to write it", path);
    else
        rc = newfile_part(path, grid->path, &fd, err);
    if (rc == SH_OK) {
        grid->spool = fdopen(fd, "w+b");
        if (grid->spool == NULL) newfile_drop(grid->path, fd);
        if (grid->spool == NULL) rc = fail_spool(grid, err);
        if (rc == SH_OK) setvbuf(grid->spool, NULL, _IOFBF, SPOOL_BUFFER);
    }
    if (rc != SH_OK) ptx_grid_close(grid);
    return rc;
}

void ptx_grid_close(struct ptx_grid *grid)
{
    if (grid->spool != NULL) {
        /* The file is ours until fclose unlocks it. */
        if (grid->is_empty || access(grid->part, F_OK) != 0) unlink(grid->path);
        fclose(grid->spool);
    }
    free(grid->path);
    free(grid->part);
    memset(grid, 0, sizeof *grid);
}

static uint32_t check_of_head(const struct ptx_head *head)
{
    return crc32c(0, head, offsetof(struct ptx_head, check));
}

static uint8_t check_of_cell(const struct ptx_cell *cell)
{
    struct ptx_cell c = *cell;
    c.check = 0;
    return (uint8_t)crc32c(0, &c, sizeof c);
}

int ptx_grid_begin(struct ptx_grid *grid, uint64_t text_at, const struct station_pose *pose, int coloured,
                   struct sh_err *err)
{
    struct ptx_head head = {.text_at = text_at, .pose = *pose, .coloured = coloured != 0};
    memcpy(head.magic, MAGIC, sizeof MAGIC);
    head.check = check_of_head(&head);
    grid->is_empty = 0;
    return ptx_grid_put(grid, &head, sizeof head, err);
}

static int widen(struct ptx_grid *grid, uint32_t column, uint32_t row, int first)
{
    const int larger =
        first || column < grid->column_min || column > grid->column_max || row < grid->row_min || row > grid->row_max;
    if (first || column < grid->column_min) grid->column_min = column;
    if (first || column > grid->column_max) grid->column_max = column;
    if (first || row < grid->row_min) grid->row_min = row;
    if (first || row > grid->row_max) grid->row_max = row;
    return larger;
}

int ptx_grid_shot(struct ptx_grid *grid, uint32_t column, uint32_t row)
{
    return widen(grid, column, row, grid->n_shots++ == 0);
}

int ptx_grid_cells(struct ptx_grid *grid, struct ptx_cell *cell, int n, struct sh_err *err)
{
    for (int i = 0; i < n; i++)
        cell[i].check = check_of_cell(&cell[i]);
    grid->n_cells += (uint64_t)n;
    return n > 0 ? ptx_grid_put(grid, cell, (size_t)n * sizeof *cell, err) : 0;
}

int ptx_grid_save(struct ptx_grid *grid, struct sh_err *err)
{
    return !ferror(grid->spool) && fflush(grid->spool) == 0 ? 0 : fail_spool(grid, err);
}

/* Cells on their way back from the file. */
struct drain {
    uint64_t left; /* not yet looked at: in the file, or in `cell` from `at` on */
    size_t at, n;
    struct ptx_cell cell[CELLS_AT_ONCE];
};

/* Returns the next cell; NULL: there is none, or it could not be read, as *rc then says. */
static const struct ptx_cell *look_at_cell(struct ptx_grid *grid, struct drain *d, int *rc, struct sh_err *err)
{
    if (d->left == 0) return NULL;
    if (d->at < d->n) return &d->cell[d->at];
    d->at = 0;
    d->n = fread(d->cell, sizeof *d->cell, d->left < CELLS_AT_ONCE ? (size_t)d->left : CELLS_AT_ONCE, grid->spool);
    if (d->n > 0) return d->cell;
    *rc = fail_read(grid, err);
    return NULL;
}

/* Fills the cells of column `at`. */
static int ptx_grid_fill(struct ptx_grid *grid, uint32_t at, struct ptx_cell *column, struct drain *d,
                         struct sh_err *err)
{
    const struct ptx_cell *cell;
    int rc = 0;
    for (uint32_t i = 0; i <= grid->row_max - grid->row_min; i++)
        column[i] = (struct ptx_cell){.intensity = -1};
    while ((cell = look_at_cell(grid, d, &rc, err)) != NULL && cell->column == at) {
        column[cell->row - grid->row_min] = *cell;
        d->at++;
        d->left--;
    }
    return rc;
}

int ptx_grid_drain(struct ptx_grid *grid,
                   int (*fn)(void *ctx, const struct ptx_cell *column, uint32_t n_rows, struct sh_err *err), void *ctx,
                   struct sh_err *err)
{
    if (grid->n_shots == 0) return 0;
    uint32_t n_rows = grid->row_max - grid->row_min + 1;
    struct drain d = {.left = grid->n_cells};
    struct ptx_cell *column = malloc(n_rows * sizeof *column);
    if (column == NULL) return sh_fail(err, SH_ENOMEM, "%s: no memory for a column of %u shots", grid->path, n_rows);
    int rc = ptx_grid_save(grid, err);
    if (rc == 0 && fseeko(grid->spool, sizeof(struct ptx_head), SEEK_SET) != 0) rc = fail_spool(grid, err);
    for (uint64_t at = grid->column_min; rc == 0 && at <= grid->column_max; at++) {
        rc = ptx_grid_fill(grid, (uint32_t)at, column, &d, err);
        if (rc == 0) rc = fn(ctx, column, n_rows, err);
    }
    if (rc == 0 && d.left > 0)
        rc = sh_fail(err, SH_EFORMAT, "%s: line numbers went back within a scan; %llu echoes are left out", grid->path,
                     (unsigned long long)d.left);
    free(column);
    if (rc == 0) grid->n_shots = grid->n_cells = 0;
    return rc;
}

int ptx_grid_clear(struct ptx_grid *grid, struct sh_err *err)
{
    rewind(grid->spool);
    if (ftruncate(fileno(grid->spool), 0) != 0) return fail_spool(grid, err);
    grid->is_empty = 1;
    return 0;
}

static int fail_damaged(const struct ptx_grid *grid, uint64_t cell, struct sh_err *err)
{
    return sh_fail(err, SH_EFORMAT, "%s: is damaged at byte %" PRIu64 ", before its end; a repair can only cut the end",
                   grid->path, sizeof(struct ptx_head) + cell * sizeof(struct ptx_cell));
}

int ptx_grid_find(struct ptx_grid *grid, struct ptx_head *head, uint64_t *cut, struct sh_err *err)
{
    struct ptx_cell cell;
    uint64_t n = 0;
    uint32_t last = 0;
    *cut = 0;
    if (fread(head, sizeof *head, 1, grid->spool) != 1 || memcmp(head->magic, MAGIC, sizeof MAGIC) != 0 ||
        head->check != check_of_head(head))
        return ferror(grid->spool) ? fail_read(grid, err) : 0;
    for (; fread(&cell, sizeof cell, 1, grid->spool) == 1; n++) {
        const int right = cell.check == check_of_cell(&cell) && (n == 0 || cell.column >= last);
        if (right && grid->n_cells < n) return fail_damaged(grid, grid->n_cells, err);
        if (!right) continue;
        widen(grid, cell.column, cell.row, n == 0);
        last = cell.column;
        grid->n_cells++;
    }
    if (ferror(grid->spool) || fseeko(grid->spool, 0, SEEK_END) != 0) return fail_read(grid, err);
    *cut = (uint64_t)ftello(grid->spool) - sizeof *head - grid->n_cells * sizeof cell;
    grid->n_shots = grid->n_cells;
    return grid->n_cells > 0;
}
