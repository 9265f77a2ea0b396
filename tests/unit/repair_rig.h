/* SPDX-License-Identifier: MIT */
/* For tests of repair: the files that killed recorders leave, beside the whole files of the same small stream. */
#ifndef TESTS_UNIT_REPAIR_RIG_H
#define TESTS_UNIT_REPAIR_RIG_H

#include "tests/unit/recorder_rig.h"

enum { REPAIR_FORMATS = 9, REPAIR_ASCII = 4, REPAIR_LAS = 6, REPAIR_POINTS = 12 };

struct bytes {
    uint8_t *data;
    size_t len;
};

struct repair_format {
    const char *name;
    struct recorder_options options;
    int knows_damage; /* a wrong byte within its units is noticed */
};

extern const struct repair_format repair_formats[REPAIR_FORMATS];
/* For each format: FILE.part when all frames had come, and FILE. */
extern struct bytes repair_left[REPAIR_FORMATS], repair_whole[REPAIR_FORMATS];
extern struct sh_err repair_err;

/* Where it is not NULL, it is called in place of each fsync. */
extern void (*repair_at_sync)(int fd);

int repair_set_up(void **state);
int repair_tear_down(void **state);

/* The file of the test; its folder is the rig's. */
extern char repair_path[160], repair_part[168];
void repair_name(const char *file);

struct bytes repair_slurp(const char *path);
void repair_write_file(const char *path, const void *data, size_t len);

#endif
