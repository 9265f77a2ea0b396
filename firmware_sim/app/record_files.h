/* The files of one `scanhead record`: opened, fed and closed together, all scans in one or one scan in each. */
#ifndef FIRMWARE_SIM_APP_RECORD_FILES_H
#define FIRMWARE_SIM_APP_RECORD_FILES_H

#include "drivers/record/recorder.h"

enum { RECORD_MAX_FILES = 8 };

struct record_files {
    int split; /* each scan to files of its own: NAME-1.ply, NAME-2.ply, ... */
    struct recorder_options recorder;
    /* inner state */
    struct record_file {
        const char *path;
        const struct recorder_ops *ops;
        struct recorder *rec;
    } file[RECORD_MAX_FILES];
    int n;
    unsigned part;  /* number of the scan in split files, from 1 */
    int has_points; /* in the present files */
};

/* SH_EINPUT: too many, twice the same, an ending without a recorder. path must live on. */
int record_files_add(struct record_files *files, const char *path, struct sh_err *err);
/* SH_EINPUT where one holds metres alone, for a stream of geodetic coordinates. */
int record_files_check_degrees(const struct record_files *files, struct sh_err *err);
int record_files_open(struct record_files *files, struct sh_err *err);
int record_files_frame(struct record_files *files, struct scanhead *sh, const struct scanhead_frame *frame,
                       struct sh_err *err);
/* Closes all, also after a failure; the first error. err may be NULL. */
int record_files_close(struct record_files *files, int keep, struct sh_err *err);

#endif
