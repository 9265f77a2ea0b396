/* SPDX-License-Identifier: MIT */
/* The files of one `scanhead record`. In: paths, then each frame of the stream. Out: the files, which a
 * recorder for each ending writes (drivers/record). All are opened, fed and closed together. All scans go
 * into the same files, or each scan into files of its own.
 *
 * Where the limits of colours are the smallest and the largest value in the files, formats with colours get their
 * frames at the end, when both are known (colour_spool.h). */
#ifndef FIRMWARE_SIM_APP_STUDIO_RECORD_FILES_H
#define FIRMWARE_SIM_APP_STUDIO_RECORD_FILES_H

#include "core/emitter.h"
#include "drivers/record/recorder.h"
#include "firmware_sim/app/studio/record/colour_spool.h"

enum { RECORD_MAX_FILES = 8 };

struct record_files {
    int split; /* each scan to files of its own: NAME-1.ply, NAME-2.ply, ... */
    struct recorder_options recorder;
    int takes_over; /* 1: overwrites a FILE.part of an earlier recording; 0: record_files_open refuses */
    int own_limits; /* the limits of recorder.colour.scale are found in the frames */
    /* inner state */
    struct recorder_padding padding; /* in all parts */
    struct record_file {
        const char *path;
        char *now; /* the path of the present file: with --split it has the scan's number */
        const struct recorder_ops *ops;
        struct recorder *rec;
        int lacks; /* some of the frames that waited could not be given to it */
    } file[RECORD_MAX_FILES];
    int n;
    unsigned part;  /* number of the scan in split files, from 1 */
    int has_points; /* a frame of points came for the present files */
    int64_t begin_ns,
        last_ns; /* device times: of the start of the last points' scan, and of the first of these points */
    struct colour_spool **spool; /* one for each head that comes, in their order; frames wait there for the limits */
    uint32_t n_spools;           /* 0: no frame has to wait */
    const struct scanhead *sh;   /* the head from which the last frame came */
};

/* SH_EINPUT: more than RECORD_MAX_FILES, a path twice, an ending without a recorder. path must live on. */
int record_files_add(struct record_files *files, const char *path, struct sh_err *err);
/* For --each: SH_EINPUT where the file of one scan would have the name of another file. */
int record_files_check_each(const struct record_files *files, struct sh_err *err);
/* To be called once all options are read: picks the format of each file according to them. */
void record_files_shape(struct record_files *files);
/* Whether one of the files is a mesh, or points spread over one. */
int record_files_have_meshes(const struct record_files *files);
/* Whether one of the files has that ending, as recorders name it. */
int record_files_have(const struct record_files *files, const char *ending);
/* Whether one of the files has a place for colours. */
int record_files_have_colours(const struct record_files *files);
/* For a stream of geodetic coordinates: SH_EINPUT where a file can hold only metres. */
int record_files_check_degrees(const struct record_files *files, struct sh_err *err);
/* For a stream in coordinates of the Earth: SH_EINPUT where a file's numbers are too coarse for them. */
int record_files_check_floats(const struct record_files *files, struct sh_err *err);
/* SH_EINPUT where a file is a mesh. why: follows "a mesh" in the error. */
int record_files_refuse_meshes(const struct record_files *files, const char *why, struct sh_err *err);
/* SH_EINPUT where a file is a grid, and a head of this kind fires without rows and columns. */
int record_files_check_emitter(const struct record_files *files, enum emitter_kind kind, struct sh_err *err);
/* SH_EINPUT where a file is the stream of one head, and several heads would send into it. */
int record_files_check_heads(const struct record_files *files, struct sh_err *err);
/* SH_EINPUT, with file and station, where a file can't hold a scan; `first` is the first scan of the recording. */
int record_files_check_scan(const struct record_files *files, const struct recorder_scan *first,
                            const struct recorder_scan *scan, struct sh_err *err);
/* SH_EINPUT: a recording that was killed has left something there, and the format can be repaired. After an error no
 * file is left. */
int record_files_open(struct record_files *files, struct sh_err *err);
/* To be called about once a second: the points so far go to the disk. */
int record_files_save(struct record_files *files, struct sh_err *err);
int record_files_frame(struct record_files *files, struct scanhead *sh, const struct scanhead_frame *frame,
                       struct sh_err *err);
/* Closes all, also after a failure; keep 0: removes the files. Returns the first error, if any; err may be NULL. Where
 * frames that waited for the limits can't be given to a file, they are kept as FILE.frames.shs in place of that file,
 * and a warning names it. The other files get all their frames. */
int record_files_close(struct record_files *files, int keep, struct sh_err *err);

#endif
