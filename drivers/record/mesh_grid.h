/* SPDX-License-Identifier: MIT */
/* The grid of a scan that is being recorded: the line and row of each point, and where the head was. A grid spans one
 * sweep of the pan, or all rings of a sphere; where sweeps have one line each, it spans all of them. In: points, as the
 * track gives them. Out: a struct scan_grid. */
#ifndef DRIVERS_RECORD_MESH_GRID_H
#define DRIVERS_RECORD_MESH_GRID_H

#include "core/studio/scan_mesh.h"
#include "drivers/record/track.h"

struct mesh_grid {
    uint32_t first;        /* of its points among all of the recording */
    uint32_t n;            /* points */
    uint32_t *row, *line;  /* [n] */
    float (*to_head_m)[3]; /* [n] of a moving head */
    struct scan_column *column;
    uint32_t n_columns;
    uint32_t line_min, line_max, row_min, row_max; /* of all points; only with points */
    uint32_t sweep, station, scan;
    int kind; /* enum scanhead_emitter_kind */
    uint32_t rings, rows_per_turn;
    double first_ring_deg, ring_step_deg;
    double lines_per_turn; /* 0: the pan does not turn */
    double head_m[3];
    int moving;
    size_t room_row, room_line, room_head, room_column; /* inner state */
};

/* SH_EFORMAT where a scan of this track has no grid, or the place of its head in the recording's frame is not known. */
int mesh_grid_check(const struct track *track, struct sh_err *err);

/* Empties the grid, for the scan and the sweep of the track's present batch; `first` is the number of points so far. */
void mesh_grid_begin(struct mesh_grid *grid, const struct track *track, uint32_t first);
/* Returns 1 if point i of the batch has a place in the grid. 0: its line or row went back, or another sweep began. */
int mesh_grid_takes(const struct mesh_grid *grid, const struct track *track, int i);
/* Takes point i, which is at xyz_m in the recording's frame. Returns 1, or 0 where the head's pose is not known, or
 * SH_ENOMEM. */
int mesh_grid_add(struct mesh_grid *grid, struct track *track, int i, const double xyz_m[3], struct sh_err *err);
/* Returns the grid for scan_faces_make. xyz_m holds all points of the recording. */
struct scan_grid mesh_grid_of(const struct mesh_grid *grid, const double (*xyz_m)[3], double long_edge);
/* Returns 1 if all shots of this line have the same direction. */
int mesh_grid_is_pole(const struct mesh_grid *grid, uint32_t line);
void mesh_grid_free(struct mesh_grid *grid);

#endif
