/* SPDX-License-Identifier: MIT */
/* A page saves the points so far as a file: .las, .ply, .e57, .ptx or .pcapng.
 *
 * In: the frames of past.h. Out: a file, in pieces. One file at a time; a thread of its own makes it, at the lowest
 * priority. The file is in a folder for temporary files until the next one is made, or until save_free. Where a scan is
 * over, the thread first waits until its end is among the frames.
 *
 * Any thread may ask. Answers take some milliseconds at most. */
#ifndef FIRMWARE_SIM_APP_STUDIO_WATCH_SAVE_H
#define FIRMWARE_SIM_APP_STUDIO_WATCH_SAVE_H

#include "drivers/link/web.h"
#include "firmware_sim/app/studio/watch/past.h"

struct save;

struct save_source {
    struct past *past;
    int (*is_behind)(void *ctx); /* 1: a scan is over, and frames of it are still to come; NULL: never */
    void *ctx;
};

enum { SAVE_PIECE = 4 << 20 }; /* the most bytes of a piece */

/* The past and ctx must live on until save_free. NULL: no memory. */
struct save *save_create(const struct save_source *source);
/* `/save?as=las` begins a file, `/save` asks for it: JSON (README.md).
 * SH_EINPUT: the format is not one of these, or a file is being made. A file that could not be made, or not even be
 * begun, is an error until the next one begins; the file before is gone then. */
int save_get(struct save *save, const char *query, struct web_body *out, struct sh_err *err);
/* `/saved?file=NUMBER&from=POSITION` gives bytes of that file from that position; at the file's end it gives none.
 * SH_EINPUT: the file is not there. */
int save_get_piece(struct save *save, const char *query, struct web_body *out, struct sh_err *err);
/* Stops a file that is being made. save may be NULL. */
void save_free(struct save *save);

#endif
