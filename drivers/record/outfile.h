/* SPDX-License-Identifier: MIT */
/* A file that appears whole or not at all (core/newfile.h). The file is written as PATH.part through a buffer. After a
 * failure PATH.part may stay with what reached the disk, for a repair (repair.h). */
#ifndef DRIVERS_RECORD_OUTFILE_H
#define DRIVERS_RECORD_OUTFILE_H

#include <stddef.h>
#include <stdint.h>

#include "core/direct.h"
#include "core/err.h"

enum { OUTFILE_BUFFER = 1 << 20 };

struct outfile {
    int fd;
    char *path, *part;
    uint8_t *buf;
    size_t len;       /* bytes in buf */
    uint64_t written; /* bytes of the file that are before buf */
    int error;        /* errno of the first write that failed: something of the file may be missing; 0: none */
    uint64_t saved;   /* `written` when outfile_save was called last */
    /* 1: the bytes from DIRECT_FROM on are written past the system's cache (O_DIRECT), where the file system can do
     * that. Such writing saves copying, which is most of the cost of a long recording. But each write then waits for
     * the disk, so only writers that may wait set it. Set after opening. */
    int may_be_direct;
    int is_direct; /* 1: O_DIRECT is set at present; -1: the file system can't do that (direct.h) */
};

/* Errors name the path; SH_EPERM, SH_EINPUT (no such folder, a link, a device), SH_EIO, SH_ENOMEM. */
int outfile_open(struct outfile *file, const char *path, struct sh_err *err);
int outfile_write(struct outfile *file, const void *data, size_t len, struct sh_err *err);
/* Returns room for n <= OUTFILE_BUFFER bytes, to be filled before the next call. Then outfile_used gets the number of
 * bytes that were filled. NULL: err. */
uint8_t *outfile_room(struct outfile *file, size_t n, struct sh_err *err);
void outfile_used(struct outfile *file, size_t n);
int outfile_flush(struct outfile *file, struct sh_err *err);
/* If an earlier write has failed, returns SH_EIO with the error of that write. */
int outfile_check(const struct outfile *file, struct sh_err *err);
/* To be called about once a second: flushes, unless a part of the file was written since the last call. So no data wait
 * for longer than two calls, and a busy writer pays nothing. */
int outfile_save(struct outfile *file, struct sh_err *err);
/* Writes bytes anywhere in the file, or behind its end. Comes right after outfile_flush(), since it writes no whole
 * blocks. */
int outfile_patch(struct outfile *file, uint64_t at, const void *data, size_t len, struct sh_err *err);
/* Removes PATH.part, so that something else can be written as PATH. Only outfile_close may follow, which then only
 * frees. */
void outfile_yield(struct outfile *file);
/* OUTFILE_KEEP: flushes, syncs and renames; where that fails, PATH.part is removed. OUTFILE_KEEP_PART: does the same,
 * but after a failure PATH.part stays, unless it is empty. OUTFILE_LEAVE: flushes what it can; PATH.part stays and is
 * not renamed, but an empty one is removed. OUTFILE_DROP: PATH.part is removed. Everything is freed in any case. */
enum outfile_end { OUTFILE_DROP = 0, OUTFILE_KEEP = 1, OUTFILE_KEEP_PART, OUTFILE_LEAVE };
int outfile_close(struct outfile *file, enum outfile_end how, struct sh_err *err);
/* Checks that no earlier recording has left data in `part`, which is PATH.part of `path`. The check is for files that a
 * repair can complete. SH_EINPUT: there are data; the text has both names. */
int outfile_check_left(const char *part, const char *path, struct sh_err *err);
/* Warns that PATH.part keeps what reached the disk, where it does. */
void outfile_say_left(const char *path, const struct sh_report *report);
/* Reserves len bytes on the disk for the end of the file, so that the end, or a repair, can be written when the disk is
 * full. The reserved room lies far beyond the end, and does not count as length. Nothing is reserved where the file
 * system can't do that, or where the length of files is limited (RLIMIT_FSIZE). SH_EIO: the disk is full. */
int outfile_reserve(struct outfile *file, uint64_t len, struct sh_err *err);
/* Frees the reserved room, for what is written next. */
void outfile_release(struct outfile *file);
/* SH_ESTOPPED where the report's stop says so: the file is given up while it is being completed. report may be NULL. */
int outfile_check_stop(const struct outfile *file, const struct sh_report *report, struct sh_err *err);
/* SH_EFORMAT, for a coordinate that is too long to be written as text. */
int outfile_fail_huge(const struct outfile *file, const double p[3], struct sh_err *err);
/* Writes over an open file from `at` on; path is for messages. SH_ENOMEM. Only outfile_leave ends it: that flushes
 * nothing, and leaves fd open. */
int outfile_over(struct outfile *file, int fd, const char *path, uint64_t at, struct sh_err *err);
void outfile_leave(struct outfile *file);

#endif
