/* SPDX-License-Identifier: MIT */
#include "drivers/record/outfile.h"

#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <unistd.h>

#include "core/newfile.h"

static const uint64_t OUTFILE_RESERVE_AT = (uint64_t)1 << 40; /* beyond any recording, and below ext4's largest file */
enum { OUTFILE_RESERVE_MOST = 1 << 30 };

void outfile_leave(struct outfile *file)
{
    free(file->path);
    free(file->part);
    free(file->buf);
    memset(file, 0, sizeof *file);
    file->fd = -1;
}

int outfile_open(struct outfile *file, const char *path, struct sh_err *err)
{
    memset(file, 0, sizeof *file);
    file->fd = -1;
    file->path = strdup(path);
    file->buf = aligned_alloc(DIRECT_BLOCK, OUTFILE_BUFFER);
    if (file->path == NULL || file->buf == NULL || asprintf(&file->part, "%s.part", path) < 0) {
        file->part = NULL;
        outfile_leave(file);
        return sh_fail(err, SH_ENOMEM, "%s: no memory to write it", path);
    }
    int rc = newfile_part(file->path, file->part, &file->fd, err);
    if (rc != 0) outfile_leave(file);
    return rc;
}

static int fail_write(struct outfile *file, int error, struct sh_err *err)
{
    if (file->error == 0) file->error = error;
    return sh_fail(err, SH_EIO, "%s: cannot write: %s", file->part, strerror(error));
}

int outfile_check(const struct outfile *file, struct sh_err *err)
{
    if (file->error == 0) return 0;
    return sh_fail(err, SH_EIO, "%s: cannot write: %s", file->part, strerror(file->error));
}

/* Moves *at on by the bytes that were written, also before a failure. */
static int write_at(struct outfile *file, uint64_t *at, const uint8_t *data, size_t len, struct sh_err *err)
{
    while (len > 0) {
        const ssize_t n = direct_pwrite(file->fd, &file->is_direct, data, len, (off_t)*at);
        if (n < 0) return fail_write(file, errno, err);
        data += n;
        len -= (size_t)n;
        *at += (uint64_t)n;
    }
    return 0;
}

/* Writes the first len bytes of the buffer. After a failure the rest stays, so that a later attempt writes no byte
 * twice. */
static int write_buffered(struct outfile *file, size_t len, struct sh_err *err)
{
    uint64_t before = file->written;
    int rc = write_at(file, &file->written, file->buf, len, err);
    size_t done = (size_t)(file->written - before);
    memmove(file->buf, file->buf + done, file->len - done);
    file->len -= done;
    return rc;
}

int outfile_flush(struct outfile *file, struct sh_err *err)
{
    direct_set(file->fd, &file->is_direct, 0); /* the end is no whole block */
    return write_buffered(file, file->len, err);
}

int outfile_save(struct outfile *file, struct sh_err *err)
{
    const int rc = file->fd >= 0 && file->written == file->saved ? outfile_flush(file, err) : 0;
    file->saved = file->written;
    return rc;
}

/* Makes room in the middle of a file. Only whole blocks can be written past the cache; the rest stays in the buffer. */
static int outfile_make_room(struct outfile *file, struct sh_err *err)
{
    if (!file->may_be_direct || file->is_direct < 0 || file->written < DIRECT_FROM)
        return write_buffered(file, file->len, err);
    const size_t rest = (size_t)((file->written + file->len) % DIRECT_BLOCK);
    if (rest >= file->len) return SH_OK;
    direct_set(file->fd, &file->is_direct, file->written % DIRECT_BLOCK == 0);
    return write_buffered(file, file->len - rest, err);
}

uint8_t *outfile_room(struct outfile *file, size_t n, struct sh_err *err)
{
    if (OUTFILE_BUFFER - file->len < n && outfile_make_room(file, err) != 0) return NULL;
    if (OUTFILE_BUFFER - file->len < n && outfile_flush(file, err) != 0)
        return NULL; /* almost the whole buffer is asked for, so the rest has to go, too */
    return file->buf + file->len;
}

void outfile_used(struct outfile *file, size_t n)
{
    file->len += n;
}

int outfile_write(struct outfile *file, const void *data, size_t len, struct sh_err *err)
{
    if (len > OUTFILE_BUFFER) {
        int rc = outfile_flush(file, err);
        return rc != 0 ? rc : write_at(file, &file->written, data, len, err);
    }
    uint8_t *to = outfile_room(file, len, err);
    if (to == NULL) return SH_EIO;
    memcpy(to, data, len);
    file->len += len;
    return 0;
}

int outfile_patch(struct outfile *file, uint64_t at, const void *data, size_t len, struct sh_err *err)
{
    return write_at(file, &at, data, len, err);
}

void outfile_yield(struct outfile *file)
{
    newfile_drop(file->part, file->fd);
    file->fd = -1;
}

/* Returns 1 if PATH.part stays, with what is on the disk. */
static int leave(struct outfile *file)
{
    struct stat st;
    if (fstat(file->fd, &st) == 0 && st.st_size == 0) return 0;
    close(file->fd);
    return 1;
}

int outfile_close(struct outfile *file, enum outfile_end how, struct sh_err *err)
{
    if (file->fd < 0) {
        outfile_leave(file);
        return 0;
    }
    int rc = how != OUTFILE_DROP ? outfile_flush(file, how == OUTFILE_LEAVE ? NULL : err) : 0, closed = 0;
    const int stays = how == OUTFILE_LEAVE || how == OUTFILE_KEEP_PART;
    if (rc == 0 && (how == OUTFILE_KEEP || how == OUTFILE_KEEP_PART)) {
        rc = newfile_settle(file->path, file->part, file->fd, err);
        closed = rc == 0;
    }
    if (!closed && !(stays && leave(file))) newfile_drop(file->part, file->fd);
    outfile_leave(file);
    return how == OUTFILE_LEAVE ? 0 : rc;
}

/* The file that a repair takes: where path is there, too, only the part's own name says which of the two is meant. */
static const char *to_repair(const char *part, const char *path)
{
    struct stat st;
    return lstat(path, &st) == 0 ? part : path;
}

int outfile_check_left(const char *part, const char *path, struct sh_err *err)
{
    const long long len = newfile_left_len(part);
    if (len == 0) return SH_OK;
    return sh_fail(
        err, SH_EINPUT,
        "%s: an earlier recording left %lld bytes there; scanhead record --repair %s makes a complete file of them; "
        "or remove it",
        part, len, to_repair(part, path));
}

void outfile_say_left(const char *path, const struct sh_report *report)
{
    char part[PATH_MAX];
    snprintf(part, sizeof part, "%s.part", path);
    if (newfile_left_len(part) > 0)
        sh_warn(report,
                "%s keeps the data that reached the disk; scanhead record --repair %s makes a complete file of it",
                part, to_repair(part, path));
}

/* Returns whether file sizes are limited. Room is reserved far beyond the end of the file. Some file systems compare
 * the place of that room with the limit, and the signal SIGXFSZ would end the program. */
static int has_limit(void)
{
    struct rlimit most;
    return getrlimit(RLIMIT_FSIZE, &most) != 0 || most.rlim_cur != RLIM_INFINITY;
}

int outfile_reserve(struct outfile *file, uint64_t len, struct sh_err *err)
{
    if (has_limit() || fallocate(file->fd, FALLOC_FL_KEEP_SIZE, (off_t)OUTFILE_RESERVE_AT, (off_t)len) == 0)
        return SH_OK;
    if (errno != ENOSPC) return SH_OK;
    return sh_fail(err, SH_EIO, "%s: cannot write: %s", file->part, strerror(errno));
}

void outfile_release(struct outfile *file)
{
    struct stat st;
    if (fstat(file->fd, &st) != 0 || (uint64_t)st.st_size > OUTFILE_RESERVE_AT) return;
    /* This fails where nothing is reserved. */
    fallocate(file->fd, FALLOC_FL_KEEP_SIZE | FALLOC_FL_PUNCH_HOLE, (off_t)OUTFILE_RESERVE_AT, OUTFILE_RESERVE_MOST);
}

int outfile_over(struct outfile *file, int fd, const char *path, uint64_t at, struct sh_err *err)
{
    *file = (struct outfile){.fd = fd, .written = at, .path = strdup(path), .part = strdup(path)};
    file->buf = aligned_alloc(DIRECT_BLOCK, OUTFILE_BUFFER);
    if (file->path != NULL && file->part != NULL && file->buf != NULL) return 0;
    outfile_leave(file);
    return sh_fail(err, SH_ENOMEM, "%s: no memory to write it", path);
}

int outfile_check_stop(const struct outfile *file, const struct sh_report *report, struct sh_err *err)
{
    if (!sh_stopped(report)) return SH_OK;
    return sh_fail(err, SH_ESTOPPED, "%s: interrupted while it was completed; it is not written", file->path);
}

int outfile_fail_huge(const struct outfile *file, const double p[3], struct sh_err *err)
{
    return sh_fail(err, SH_EFORMAT, "%s: a coordinate has more digits than this format allows: %g %g %g", file->path,
                   p[0], p[1], p[2]);
}
