/* SPDX-License-Identifier: MIT */
/* For tests of the page's /save: frames that a head keeps, and files that are made of them. */
#ifndef TESTS_UNIT_SAVE_RIG_H
#define TESTS_UNIT_SAVE_RIG_H

#include "drivers/host/scanhead.h"
#include "firmware_sim/app/studio/watch/save.h"
#include "tests/unit/commands_rig.h"

extern struct past *save_rig_past;
extern struct save *save_rig;

/* Makes two scans of a floor, as s.shs and s.ply in a folder of the test, and as frames that a head keeps. */
int save_rig_begin(void **state);
int save_rig_end(void **state);

/* Opens and closes the saver of those frames. */
int save_rig_open(void **state);
int save_rig_close(void **state);

/* Sets the folder for temporary files: `t`, which exists, or another one, which does not. */
void save_rig_set_temporary(const char *name);

/* Takes the frames of the recording, up to so many points frames. Returns whether there are more. */
int save_rig_take(struct past *to, struct scanhead *sh, uint32_t n_points);

/* Waits until the file is made, or has failed: the thread that makes it gets a processor some time. */
void save_rig_wait(void);

/* Fetches a file in pieces. Returns its bytes; free them. */
char *save_rig_fetch(unsigned number, size_t *len);

/* Returns the size of a file. */
size_t save_rig_bytes(const char *path);

/* Expects the points of s.ply in the file. The headers differ in comments alone, which say how the files were made. */
void save_rig_same_points(const char *got, size_t len);

/* Makes a PLY. Standard error goes to a file meanwhile: nobody asked the head for a recorder's words. */
void save_rig_make_ply(void);

#endif
