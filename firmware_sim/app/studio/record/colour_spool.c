/* SPDX-License-Identifier: MIT */
#include "firmware_sim/app/studio/record/colour_spool.h"

#include <errno.h>
#include <fcntl.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

enum { FRAMES_BETWEEN_STOPS = 256 };

static int look_at_scan(void *ctx, struct sh_err *err)
{
    const struct colour_spool *spool = ctx;
    return colour_check(spool->mode, &spool->track, err);
}

static int look_at_points(void *ctx, int n, struct sh_err *err)
{
    struct colour_spool *spool = ctx;
    (void)err;
    for (int i = 0; i < n; i++) {
        const double figure = colour_figure(spool->mode, &spool->track, i);
        if (!isfinite(figure)) continue;
        if (!spool->has_points || figure < spool->low) spool->low = figure;
        if (!spool->has_points || figure > spool->high) spool->high = figure;
        spool->has_points = 1;
    }
    return SH_OK;
}

static int fail_spool(const struct colour_spool *spool, struct sh_err *err)
{
    const int code = errno == EACCES || errno == EPERM || errno == EROFS ? SH_EPERM
                     : errno == ENOENT || errno == ENOTDIR               ? SH_EINPUT
                                                                         : SH_EIO;
    return sh_fail(err, code, "%s: cannot keep the frames until the limits of the colours are known: %s",
                   spool->track.path, strerror(errno));
}

/* Makes a file without a name in the folder of `path`: it vanishes with this process, even a killed one. A file of
 * O_TMPFILE can get a name later, and a file that was unlinked can't; but not all file systems have O_TMPFILE. */
static int open_nameless(const char *path, int *is_unlinked)
{
    char *folder = strndup(path, (size_t)(basename(path) - path)), *name = NULL;
    int fd = -1;
    if (folder != NULL) fd = open(folder[0] != '\0' ? folder : ".", O_TMPFILE | O_RDWR | O_CLOEXEC, 0666);
    free(folder);
    if (fd >= 0 || asprintf(&name, "%s.frames-XXXXXX", path) < 0) return fd;
    fd = mkostemp(name, O_CLOEXEC);
    *is_unlinked = fd >= 0 && unlink(name) == 0;
    const int why = errno;
    free(name);
    errno = why;
    return fd;
}

int colour_spool_open(struct colour_spool *spool, const char *path, enum colour_mode mode, struct sh_err *err)
{
    static const struct track_ops ops = {.scan = look_at_scan, .points = look_at_points};
    memset(spool, 0, sizeof *spool);
    spool->mode = mode;
    spool->track.path = path;
    spool->track.ops = &ops;
    spool->track.rec = spool;
    const int fd = open_nameless(path, &spool->is_unlinked);
    if (fd < 0) return fail_spool(spool, err);
    spool->file = fdopen(fd, "w+b");
    if (spool->file != NULL) return SH_OK;
    close(fd);
    return fail_spool(spool, err);
}

int colour_spool_frame(struct colour_spool *spool, struct scanhead *sh, const struct scanhead_frame *frame,
                       struct sh_err *err)
{
    const int rc = track_frame(&spool->track, sh, frame, err);
    if (rc != SH_OK) return rc; /* the frames that were stored before can still be read */
    if (fwrite(frame->raw, frame->raw_len, 1, spool->file) != 1) return fail_spool(spool, err);
    spool->bytes += frame->raw_len;
    return SH_OK;
}

/* The handle gets a descriptor of its own, which it closes. */
static int open_again(struct colour_spool *spool, struct sh_err *err)
{
    char source[32], why[512];
    if (fflush(spool->file) != 0 || lseek(fileno(spool->file), 0, SEEK_SET) != 0) return fail_spool(spool, err);
    const int fd = dup(fileno(spool->file));
    if (fd < 0) return fail_spool(spool, err);
    snprintf(source, sizeof source, "fd:%d", fd);
    const int rc = scanhead_open(source, &spool->sh, why, sizeof why);
    if (rc == SCANHEAD_OK) return SH_OK;
    close(fd);
    spool->sh = NULL;
    return sh_fail(err, rc, "%s: %s", spool->track.path, why);
}

int colour_spool_drain(struct colour_spool *spool,
                       int (*fn)(void *ctx, struct scanhead *sh, const struct scanhead_frame *frame,
                                 struct sh_err *err),
                       void *ctx, const struct sh_report *report, struct sh_err *err)
{
    struct scanhead_frame frame;
    struct scanhead_stats stats = {0};
    uint64_t done = 0;
    int rc = open_again(spool, err), got = SCANHEAD_OK;
    for (uint32_t n = 1; rc == SH_OK && (got = scanhead_next(spool->sh, &frame, -1)) == SCANHEAD_OK; n++) {
        rc = fn(ctx, spool->sh, &frame, err);
        done += frame.raw_len;
        if (rc != SH_OK || n % FRAMES_BETWEEN_STOPS != 0) continue;
        sh_progress(report, "colouring the points", (double)done / (double)spool->bytes);
        if (sh_stopped(report)) rc = sh_fail(err, SH_ESTOPPED, "interrupted while points were coloured");
    }
    /* Compares bytes, not numbers of frames: after a replug a frame may equal an earlier one, and the handle then drops
     * it as a repetition. */
    if (rc == SH_OK) scanhead_get_stats(spool->sh, &stats);
    if (rc == SH_OK && (got != SCANHEAD_ECLOSED || stats.bytes != spool->bytes || stats.bad_bytes + stats.refused != 0))
        rc = sh_fail(err, SH_EIO, "%s: the stored frames can't be read back: %s", spool->track.path,
                     scanhead_error(spool->sh));
    return rc;
}

int colour_spool_keep(struct colour_spool *spool, const char *path, struct sh_err *err)
{
    char own[32];
    struct stat st;
    if (spool->file == NULL || spool->bytes == 0) return sh_fail(err, SH_ESTATE, "%s: there are no frames", path);
    const int fd = fileno(spool->file);
    int rc = fflush(spool->file) == 0 ? SH_OK : SH_EIO; /* where the disk is full, the last frames are missing */
    snprintf(own, sizeof own, "/proc/self/fd/%d", fd);
    if (rc == SH_OK && (fstat(fd, &st) != 0 || (uint64_t)st.st_size != spool->bytes || fsync(fd) != 0)) rc = SH_EIO;
    const char *end = rc == SH_OK ? "" : ".part";
    char *name = NULL;
    if (asprintf(&name, "%s%s", path, end) < 0) return sh_fail(err, SH_ENOMEM, "%s: no memory for its name", path);
    if (spool->is_unlinked)
        rc =
            sh_fail(err, SH_ESTATE,
                    "%s: cannot keep the frames: a file without a name can't get one on this file system, as it has no "
                    "O_TMPFILE",
                    name);
    else if (linkat(AT_FDCWD, own, AT_FDCWD, name, AT_SYMLINK_FOLLOW) != 0)
        rc = sh_fail(err, SH_ESTATE, "%s: cannot keep the frames: %s", name, strerror(errno));
    else if (rc != SH_OK)
        sh_fail(err, rc, "%s: the last frames could not be written", name);
    free(name);
    return rc;
}

void colour_spool_close(struct colour_spool *spool)
{
    if (spool->sh != NULL) scanhead_close(spool->sh);
    if (spool->file != NULL) fclose(spool->file);
    track_free(&spool->track);
}
