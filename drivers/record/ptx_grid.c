#include "drivers/record/ptx_grid.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

int ptx_grid_open(struct ptx_grid *grid, const char *path, struct sh_err *err)
{
    memset(grid, 0, sizeof *grid);
    if (asprintf(&grid->path, "%s.grid-XXXXXX", path) < 0) {
        grid->path = NULL;
        return sh_fail(err, SH_ENOMEM, "%s: no memory to write it", path);
    }
    int fd = mkstemp(grid->path);
    if (fd >= 0) {
        unlink(grid->path); /* gone with its last user, however that ends */
        grid->spool = fdopen(fd, "w+b");
        if (grid->spool == NULL) close(fd);
    }
    if (grid->spool != NULL) return 0;
    int code = errno == EACCES || errno == EPERM || errno == EROFS ? SH_EPERM : errno == ENOENT ? SH_EINPUT : SH_EIO;
    sh_fail(err, code, "%s: cannot create: %s", grid->path, strerror(errno));
    ptx_grid_close(grid);
    return code;
}

void ptx_grid_close(struct ptx_grid *grid)
{
    if (grid->spool != NULL) fclose(grid->spool);
    free(grid->path);
    memset(grid, 0, sizeof *grid);
}

void ptx_grid_shot(struct ptx_grid *grid, uint32_t column, uint32_t row)
{
    int first = grid->n_shots++ == 0;
    if (first || column < grid->column_min) grid->column_min = column;
    if (first || column > grid->column_max) grid->column_max = column;
    if (first || row < grid->row_min) grid->row_min = row;
    if (first || row > grid->row_max) grid->row_max = row;
}

static int fail_spool(const struct ptx_grid *grid, struct sh_err *err)
{
    return sh_fail(err, SH_EIO, "%s: cannot keep the grid: %s", grid->path, strerror(errno));
}

int ptx_grid_cell(struct ptx_grid *grid, const struct ptx_cell *cell, struct sh_err *err)
{
    grid->n_cells++;
    return fwrite(cell, sizeof *cell, 1, grid->spool) == 1 ? 0 : fail_spool(grid, err);
}

static void blank(struct ptx_cell *column, uint32_t n_rows)
{
    for (uint32_t i = 0; i < n_rows; i++)
        column[i] = (struct ptx_cell){.intensity = -1};
}

/* The cells of one column; the first one of the next stays in `cell`. */
static int fill(struct ptx_grid *grid, uint32_t at, struct ptx_cell *column, struct ptx_cell *cell, uint64_t *left,
                struct sh_err *err)
{
    while (*left > 0 && cell->column == at) {
        column[cell->row - grid->row_min] = *cell;
        if (--*left > 0 && fread(cell, sizeof *cell, 1, grid->spool) != 1) return fail_spool(grid, err);
    }
    return 0;
}

int ptx_grid_drain(struct ptx_grid *grid,
                   int (*fn)(void *ctx, const struct ptx_cell *column, uint32_t n_rows, struct sh_err *err), void *ctx,
                   struct sh_err *err)
{
    if (grid->n_shots == 0) return 0;
    uint32_t n_rows = grid->row_max - grid->row_min + 1;
    uint64_t left = grid->n_cells;
    struct ptx_cell cell, *column = malloc(n_rows * sizeof *column);
    if (column == NULL) return sh_fail(err, SH_ENOMEM, "%s: no memory for a column of %u shots", grid->path, n_rows);
    int rc = fflush(grid->spool) == 0 && fseeko(grid->spool, 0, SEEK_SET) == 0 ? 0 : fail_spool(grid, err);
    if (rc == 0 && left > 0 && fread(&cell, sizeof cell, 1, grid->spool) != 1) rc = fail_spool(grid, err);
    for (uint64_t at = grid->column_min; rc == 0 && at <= grid->column_max; at++) {
        blank(column, n_rows);
        rc = fill(grid, (uint32_t)at, column, &cell, &left, err);
        if (rc == 0) rc = fn(ctx, column, n_rows, err);
    }
    if (rc == 0 && left > 0)
        rc = sh_fail(err, SH_EFORMAT, "%s: lines of a scan went back; %llu echoes have no place", grid->path,
                     (unsigned long long)left);
    free(column);
    rewind(grid->spool);
    grid->n_shots = grid->n_cells = 0;
    return rc == 0 && ftruncate(fileno(grid->spool), 0) != 0 ? fail_spool(grid, err) : rc;
}
