/* A file that appears whole or not at all (core/newfile.h). It is written as PATH.part through a buffer. */
#ifndef DRIVERS_RECORD_OUTFILE_H
#define DRIVERS_RECORD_OUTFILE_H

#include <stddef.h>
#include <stdint.h>

#include "core/err.h"

enum { OUTFILE_BUFFER = 1 << 20 };

struct outfile {
    int fd;
    char *path, *part;
    uint8_t *buf;
    size_t len;       /* bytes in buf */
    uint64_t written; /* bytes of the file that are before buf */
};

/* Errors name the path; SH_EPERM, SH_EINPUT (no such folder, a link, a device), SH_EIO, SH_ENOMEM. */
int outfile_open(struct outfile *file, const char *path, struct sh_err *err);
int outfile_write(struct outfile *file, const void *data, size_t len, struct sh_err *err);
/* Room for n <= OUTFILE_BUFFER bytes, to be filled before the next call; outfile_used() says how many were.
 * NULL: err. */
uint8_t *outfile_room(struct outfile *file, size_t n, struct sh_err *err);
void outfile_used(struct outfile *file, size_t n);
int outfile_flush(struct outfile *file, struct sh_err *err);
/* Overwrites bytes that were flushed. */
int outfile_patch(struct outfile *file, uint64_t at, const void *data, size_t len, struct sh_err *err);
/* keep: flush, sync, rename. Else, and when that fails, PATH.part is removed. Frees everything in any
 * case. */
int outfile_close(struct outfile *file, int keep, struct sh_err *err);

#endif
