/* Recorders: points -> a file, by its ending. One ops struct, one file each. */
#ifndef DRIVERS_RECORD_RECORDER_H
#define DRIVERS_RECORD_RECORDER_H

#include "core/err.h"
#include "drivers/host/scanhead.h"

struct recorder_options {
    int ascii;       /* PLY as text */
    int empty_shots; /* keep shots without echo, where the format can */
    /* Told at the end what the format had no room for. May be NULL; must live until close. */
    const struct sh_report *report;
};

struct recorder_ops {
    const char *ending; /* ".ply" */
    /* Opens path for writing. Nothing is written to path itself before close succeeds: the data go to a file beside it
     * (".part") that is renamed at the end; options are copied. */
    int (*open)(const char *path, const struct recorder_options *options, void **rec, struct sh_err *err);
    /* Each frame of the stream, in order, with the handle for info, points and surfaces. */
    int (*frame)(void *rec, struct scanhead *sh, const struct scanhead_frame *frame, struct sh_err *err);
    /* Finishes the file (counts in the header), syncs and renames. rec is void afterwards, also on failure.
     * keep = 0: throws the file away. */
    int (*close)(void *rec, int keep, struct sh_err *err);
    int metres; /* 1: its coordinates are metres, a geodetic stream is refused with its first points */
};

/* By the path's ending; NULL and the list of known endings in err when there is none. */
const struct recorder_ops *recorder_find(const char *path, struct sh_err *err);

#endif
