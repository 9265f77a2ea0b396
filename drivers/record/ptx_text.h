/* SPDX-License-Identifier: MIT */
/* A grid as the text of PTX. The cells go in (ptx_grid.h), lines come out: columns, rows, the pose, then one line per
 * cell. For the recorder and for the repair. */
#ifndef DRIVERS_RECORD_PTX_TEXT_H
#define DRIVERS_RECORD_PTX_TEXT_H

#include "drivers/record/outfile.h"
#include "drivers/record/ptx_grid.h"

/* One column of a grid is held in memory: 160 MiB for so many rows. Heads have up to 550,000 rows. */
enum { PTX_ROWS_MAX = 1 << 22 };

/* The line of a shot without echo, without and with colours. */
extern const char ptx_text_empty[2][17];

struct ptx_text {
    struct outfile *file;
    struct ptx_grid *grid;
    const struct station_pose *pose;
    int coloured;
    const struct sh_report *report; /* takes progress, and may ask to stop; NULL: none */
    /* out */
    uint64_t n_points;
    /* inner state */
    uint64_t n_columns, n_rows_unreported; /* so far; since the last report of progress */
};

/* Puts the grid. Its shots are then gone, unless this failed (ptx_grid_drain). SH_EFORMAT: a coordinate is too long. */
int ptx_text_put(struct ptx_text *text, struct sh_err *err);

#endif
