/* The shots of one scan, kept in a nameless file until the scan is over: a PTX grid begins with its size, and
 * all its columns are of the same height, which is known last. Memory holds one column. */
#ifndef DRIVERS_RECORD_PTX_GRID_H
#define DRIVERS_RECORD_PTX_GRID_H

#include <stdint.h>
#include <stdio.h>

#include "core/err.h"

struct ptx_cell {
    uint32_t column, row;
    float intensity;        /* 0..1 */
    uint8_t rgb[3], unused; /* no gap: cells are written as they are */
    double p_socs[3];
};

struct ptx_grid {
    FILE *spool;
    char *path;                                        /* what the file was made as */
    uint32_t column_min, column_max, row_min, row_max; /* of all shots, those without echo included */
    uint64_t n_shots, n_cells;
};

/* The file is made in the folder of path. SH_EIO, SH_EPERM, SH_ENOMEM. */
int ptx_grid_open(struct ptx_grid *grid, const char *path, struct sh_err *err);
void ptx_grid_close(struct ptx_grid *grid);
/* A shot at this place; cells are then given for those with an echo. Columns never go back. */
void ptx_grid_shot(struct ptx_grid *grid, uint32_t column, uint32_t row);
int ptx_grid_cell(struct ptx_grid *grid, const struct ptx_cell *cell, struct sh_err *err);
/* Calls fn for each column with its cells from row_min to row_max; a cell without echo has intensity -1. Then
 * the grid is empty again. */
int ptx_grid_drain(struct ptx_grid *grid,
                   int (*fn)(void *ctx, const struct ptx_cell *column, uint32_t n_rows, struct sh_err *err), void *ctx,
                   struct sh_err *err);

#endif
