/* SPDX-License-Identifier: MIT */
/* Tags of a TIFF's first directory. Nothing in the file is trusted: what lies outside of it is an error. */
#ifndef CORE_IMPORT_GEOTIFF_TAGS_H
#define CORE_IMPORT_GEOTIFF_TAGS_H

#include <stddef.h>
#include <stdint.h>
#include <stdio.h>

#include "core/err.h"

struct tags {
    const char *path;
    FILE *file;
    int is_big_endian, is_big; /* BigTIFF: counts and offsets have 64 bits */
    uint64_t first, n;         /* the directory's entries: offset in the file, number */
};

/* tags_close is due in any case. */
int tags_open(struct tags *tags, const char *path, struct sh_err *err);
void tags_close(struct tags *tags);

/* Reads up to `most` numbers of a tag. *n: how many; 0: there is no such tag. SH_EINPUT also for a type other than the
 * TIFF types 2, 3, 4, 12 and 16. */
int tags_numbers(const struct tags *tags, unsigned tag, double *out, size_t most, size_t *n, struct sh_err *err);
/* Reads the text of a tag; empty: there is none, or the tag has numbers. SH_EINPUT: there is no room for the text and a
 * NUL. */
int tags_text(const struct tags *tags, unsigned tag, char *out, size_t room, struct sh_err *err);

#endif
