#include "drivers/record/outfile.h"

#include <errno.h>
#include <fcntl.h>
#include <libgen.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

static void release(struct outfile *file)
{
    if (file->fd >= 0) close(file->fd);
    free(file->path);
    free(file->part);
    free(file->buf);
    memset(file, 0, sizeof *file);
    file->fd = -1;
}

/* The part file, empty and ours alone: two recordings into one file, by whatever names, would end in
 * neither. */
static int create_part(struct outfile *file, struct sh_err *err)
{
    struct stat st;
    if (stat(file->path, &st) == 0 && S_ISDIR(st.st_mode))
        return sh_fail(err, SH_EINPUT, "%s: is a directory; allowed is the name of a file", file->path);
    file->fd = open(file->part, O_RDWR | O_CREAT | O_CLOEXEC, 0666);
    if (file->fd >= 0 && flock(file->fd, LOCK_EX | LOCK_NB) != 0 && errno == EWOULDBLOCK)
        return sh_fail(err, SH_EINPUT, "%s: is being written by another recording; allowed is a file of its own",
                       file->part);
    if (file->fd >= 0 && ftruncate(file->fd, 0) == 0) return 0;
    int code = errno == EACCES || errno == EPERM || errno == EROFS ? SH_EPERM : errno == ENOENT ? SH_EINPUT : SH_EIO;
    return sh_fail(err, code, "%s: cannot create: %s", file->part, strerror(errno));
}

int outfile_open(struct outfile *file, const char *path, struct sh_err *err)
{
    memset(file, 0, sizeof *file);
    file->fd = -1;
    file->path = strdup(path);
    file->buf = malloc(OUTFILE_BUFFER);
    if (file->path == NULL || file->buf == NULL || asprintf(&file->part, "%s.part", path) < 0) {
        file->part = NULL;
        release(file);
        return sh_fail(err, SH_ENOMEM, "%s: no memory to write it", path);
    }
    int code = create_part(file, err);
    if (code != 0) release(file);
    return code;
}

/* *at is moved on by what was written, also before a failure. */
static int write_at(const struct outfile *file, uint64_t *at, const uint8_t *data, size_t len, struct sh_err *err)
{
    while (len > 0) {
        ssize_t n = pwrite(file->fd, data, len, (off_t)*at);
        if (n < 0 && errno == EINTR) continue;
        if (n <= 0) return sh_fail(err, SH_EIO, "%s: cannot write: %s", file->part, strerror(n < 0 ? errno : ENOSPC));
        data += n;
        len -= (size_t)n;
        *at += (uint64_t)n;
    }
    return 0;
}

int outfile_flush(struct outfile *file, struct sh_err *err)
{
    uint64_t before = file->written;
    int rc = write_at(file, &file->written, file->buf, file->len, err);
    size_t done = (size_t)(file->written - before);
    /* after a failure the rest stays, so that a later attempt writes no byte twice */
    memmove(file->buf, file->buf + done, file->len - done);
    file->len -= done;
    return rc;
}

uint8_t *outfile_room(struct outfile *file, size_t n, struct sh_err *err)
{
    if (OUTFILE_BUFFER - file->len < n && outfile_flush(file, err) != 0) return NULL;
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

/* So that the new name survives a power cut as well. Some file systems can't sync a directory; then they need
 * not. */
static void sync_directory(const char *path)
{
    char *copy = strdup(path);
    if (copy == NULL) return;
    int fd = open(dirname(copy), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    if (fd >= 0) {
        fsync(fd);
        close(fd);
    }
    free(copy);
}

static int publish(struct outfile *file, struct sh_err *err)
{
    int rc = outfile_flush(file, err);
    if (rc != 0) return rc;
    /* pipes and the like can't be synced, and needn't */
    if (fsync(file->fd) != 0 && errno != EINVAL)
        return sh_fail(err, SH_EIO, "%s: cannot sync: %s", file->part, strerror(errno));
    int fd = file->fd;
    file->fd = -1;
    if (close(fd) != 0) return sh_fail(err, SH_EIO, "%s: cannot close: %s", file->part, strerror(errno));
    if (rename(file->part, file->path) != 0)
        return sh_fail(err, SH_EIO, "%s: cannot rename to %s: %s", file->part, file->path, strerror(errno));
    sync_directory(file->path);
    return 0;
}

int outfile_close(struct outfile *file, int keep, struct sh_err *err)
{
    int rc = keep ? publish(file, err) : 0;
    if (rc != 0 || !keep) unlink(file->part);
    release(file);
    return rc;
}
