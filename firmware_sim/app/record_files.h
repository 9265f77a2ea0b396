/* The files of one `scanhead record`. In: paths, then each frame of the stream. Out: the files, which a
 * recorder for each ending writes (drivers/record). All are opened, fed and closed together. All scans go
 * into the same files, or each scan into files of its own. */
#ifndef FIRMWARE_SIM_APP_RECORD_FILES_H
#define FIRMWARE_SIM_APP_RECORD_FILES_H

#include "core/emitter.h"
#include "drivers/record/recorder.h"

enum { RECORD_MAX_FILES = 8 };

struct record_files {
    int split; /* each scan to files of its own: NAME-1.ply, NAME-2.ply, ... */
    struct recorder_options recorder;
    /* inner state */
    struct recorder_padding padding; /* in all parts */
    struct record_file {
        const char *path;
        const struct recorder_ops *ops;
        struct recorder *rec;
    } file[RECORD_MAX_FILES];
    int n;
    unsigned part;  /* number of the scan in split files, from 1 */
    int has_points; /* in the present files */
};

/* SH_EINPUT: more than RECORD_MAX_FILES, a path twice, an ending without a recorder. path must live on. */
int record_files_add(struct record_files *files, const char *path, struct sh_err *err);
/* Whether one of them has that ending, as recorders name it. */
int record_files_have(const struct record_files *files, const char *ending);
/* For a stream of geodetic coordinates: SH_EINPUT where a file can hold only metres. */
int record_files_check_degrees(const struct record_files *files, struct sh_err *err);
/* SH_EINPUT where a file is a grid, and such a head fires without rows and columns. */
int record_files_check_emitter(const struct record_files *files, enum emitter_kind kind, struct sh_err *err);
int record_files_open(struct record_files *files, struct sh_err *err);
int record_files_frame(struct record_files *files, struct scanhead *sh, const struct scanhead_frame *frame,
                       struct sh_err *err);
/* Closes all, also after a failure; keep 0: removes them. The first error, if any; err may be NULL. */
int record_files_close(struct record_files *files, int keep, struct sh_err *err);

#endif
