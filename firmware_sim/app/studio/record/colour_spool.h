/* SPDX-License-Identifier: MIT */
/* Keeps the frames of a recording until its colours' limits are known: the smallest and the largest value. In: each
 * frame of the stream. Out: these two figures, and the frames again, in their order. The frames lie in a nameless file
 * beside the recording; memory holds none of them. One thread. */
#ifndef FIRMWARE_SIM_APP_STUDIO_RECORD_COLOUR_SPOOL_H
#define FIRMWARE_SIM_APP_STUDIO_RECORD_COLOUR_SPOOL_H

#include <stdio.h>

#include "drivers/host/scanhead.h"
#include "drivers/record/track.h"

struct colour_spool {
    double low, high; /* of the points so far; both 0 where there are none */
    /* inner state */
    enum colour_mode mode;
    FILE *file;
    uint64_t bytes;
    int has_points, is_unlinked; /* the file had a name, so it can't get another one */
    struct track track;
    struct scanhead *sh; /* reads the stored frames back */
};

/* mode: one with limits. The file is made in the folder of path. The string path must live on. SH_EIO, SH_EPERM,
 * SH_EINPUT, SH_ENOMEM. colour_spool_close is due in any case. */
int colour_spool_open(struct colour_spool *spool, const char *path, enum colour_mode mode, struct sh_err *err);
/* Errors as track_frame has them, or SH_EIO. */
int colour_spool_frame(struct colour_spool *spool, struct scanhead *sh, const struct scanhead_frame *frame,
                       struct sh_err *err);
/* Calls fn with each frame and a handle, which lives until colour_spool_close. SH_ESTOPPED where report asks to stop;
 * progress goes to it. */
int colour_spool_drain(struct colour_spool *spool,
                       int (*fn)(void *ctx, struct scanhead *sh, const struct scanhead_frame *frame,
                                 struct sh_err *err),
                       void *ctx, const struct sh_report *report, struct sh_err *err);
/* After a failure: gives the file of the frames the name `path`, which ends in .shs and must be free. SH_EIO: the last
 * frames are missing, and the file is `path`.part, as a recording that was killed. SH_ESTATE: there is no such file;
 * the name is taken, or the file system can't name such a file. */
int colour_spool_keep(struct colour_spool *spool, const char *path, struct sh_err *err);
void colour_spool_close(struct colour_spool *spool);

#endif
