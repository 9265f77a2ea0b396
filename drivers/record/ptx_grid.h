/* SPDX-License-Identifier: MIT */
/* The shots of one scan, kept in a file beside the recording (PATH.grid) until the scan is over. A PTX grid begins with
 * its size, and all its columns have the same height, so the grid can be written only then. Memory holds one column.
 *
 * A recorder that was killed leaves the file there, and a repair makes the grid from it (ptx_repair.c). The file has a
 * head, then cells; each has a checksum. A shot without echo has a cell only where the size of the grid depends on it.
 * Numbers are in the machine's byte order. */
#ifndef DRIVERS_RECORD_PTX_GRID_H
#define DRIVERS_RECORD_PTX_GRID_H

#include <stdint.h>
#include <stdio.h>

#include "core/err.h"
#include "drivers/record/station_pose.h"

/* A shot of the grid. The struct has no padding bytes, since it is written as a whole. */
struct ptx_cell {
    uint32_t column, row;
    float intensity; /* 0..1 */
    uint8_t rgb[3];
    uint8_t check; /* checksum of the other bytes; ptx_grid_cells sets it */
    double p_socs[3];
};

/* The head of a grid's file, before its cells. */
struct ptx_head {
    char magic[8];
    uint64_t text_at; /* bytes of the recording before the text of the grid */
    struct station_pose pose;
    uint32_t coloured, check;
};

struct ptx_grid {
    FILE *spool;
    char *path, *part;                                 /* of the file; of the recording as long as it is written */
    uint32_t column_min, column_max, row_min, row_max; /* of all shots, those without echo included */
    uint64_t n_shots, n_cells;
    int is_empty; /* the file is empty: there is no grid */
};

/* Makes the file for a recording at `path`. SH_EIO, SH_EPERM, SH_EINPUT, SH_ENOMEM. */
int ptx_grid_open(struct ptx_grid *grid, const char *path, struct sh_err *err);
/* Removes the file, unless it holds a grid that is not yet in the recording's PATH.part, and PATH.part exists. */
void ptx_grid_close(struct ptx_grid *grid);
/* To be called before the first shot of a grid: writes the head. */
int ptx_grid_begin(struct ptx_grid *grid, uint64_t text_at, const struct station_pose *pose, int coloured,
                   struct sh_err *err);
/* Takes a shot at this place. Returns 1 if it makes the grid larger. For each shot with an echo, and each that makes
 * the grid larger, the caller then gives a cell to ptx_grid_cells. Columns never go back. */
int ptx_grid_shot(struct ptx_grid *grid, uint32_t column, uint32_t row);
/* Takes n cells; intensity -1: a shot without echo. */
int ptx_grid_cells(struct ptx_grid *grid, struct ptx_cell *cell, int n, struct sh_err *err);
/* Flushes: the file then has all cells that were given so far. */
int ptx_grid_save(struct ptx_grid *grid, struct sh_err *err);
/* Calls fn for each column with its cells from row_min to row_max; a cell without echo has intensity -1. Then
 * the grid is without shots, unless this failed; its file stays until ptx_grid_clear. */
int ptx_grid_drain(struct ptx_grid *grid,
                   int (*fn)(void *ctx, const struct ptx_cell *column, uint32_t n_rows, struct sh_err *err), void *ctx,
                   struct sh_err *err);
/* Empties the file; to be called once the text is in the recording. */
int ptx_grid_clear(struct ptx_grid *grid, struct sh_err *err);

/* ---- for a repair: the caller has set path, and spool, which is at its begin; all other members are 0. */

/* 1: the file holds a grid; *head and the size are set, and *cut is the number of bytes at its end that are no cell. 0:
 * the file holds no grid. SH_EFORMAT: it is damaged. */
int ptx_grid_find(struct ptx_grid *grid, struct ptx_head *head, uint64_t *cut, struct sh_err *err);

#endif
