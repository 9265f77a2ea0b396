/* SPDX-License-Identifier: MIT */
/* For tests of repair: the disk's contents while a recording goes on, and a file that is repaired in place. */
#ifndef TESTS_UNIT_KILLED_RIG_H
#define TESTS_UNIT_KILLED_RIG_H

#include "tests/unit/recorder_rig.h"

/* Records the rig's stream. After each frame, once the recorder has saved its bytes, `seen` is called. After the last
 * frame the file is completed as path. */
void killed_rig_record(const char *path, struct recorder_options options, void (*seen)(const char *path));

/* Writes these bytes to path. */
void killed_rig_write(const char *path, const void *data, size_t len);

/* Repairs the file at path in place; its format is that of the ending, before .part. */
int killed_rig_repair(const char *path, struct repair *repair, struct sh_err *err);

#endif
