/* SPDX-License-Identifier: MIT */
/* Reads the command line of `record`. `batch` makes such a line for each of its jobs, so that it has the options of
 * `record` as they are. In: argv. Out: one recording (job.h), with the settings of keys. */
#ifndef FIRMWARE_SIM_APP_STUDIO_RECORD_LINE_H
#define FIRMWARE_SIM_APP_STUDIO_RECORD_LINE_H

#include "firmware_sim/app/app.h"
#include "firmware_sim/app/studio/record/job.h"

enum { RECORD_MAX_REPAIRS = 64, RECORD_LONG_EDGE = 10 /* the default of --long-edge */ };

struct record_line {
    struct app_input in;
    struct record_job job;
    int quiet;
    double long_edge;                       /* negative: not given */
    long sparse_seed;                       /* likewise */
    int las_version;                        /* 0: 1.2, 1: 1.4; negative: not given */
    int limited;                            /* --colour-limits */
    int raw;                                /* 1: raw.h reads the whole line instead */
    int raw_only;                           /* 1: an option that needs --raw was given */
    const char *repair[RECORD_MAX_REPAIRS]; /* --repair; with it nothing is recorded */
    int n_repairs;
};

/* APP_GO_ON, or the exit status with the reason printed. The strings are argv's own, or lie in `line`, which must
 * stay where it is. */
int record_line_read(struct record_line *line, int argc, char **argv);

/* ---- for record_line_read: other files of the line, which no option may name, too (app_check_files) */

/* Adds what is written beside each file of -o. APP_OK, or APP_USAGE with the reason printed. */
int record_line_add_files(struct record_line *line);
/* Adds what each --repair reads and writes beside its file. APP_GO_ON, or APP_USAGE with the reason printed. */
int record_line_add_repaired(struct record_line *line);

#endif
