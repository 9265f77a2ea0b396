#include "drivers/record/outfile.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "core/newfile.h"

static void release(struct outfile *file)
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
    file->buf = malloc(OUTFILE_BUFFER);
    if (file->path == NULL || file->buf == NULL || asprintf(&file->part, "%s.part", path) < 0) {
        file->part = NULL;
        release(file);
        return sh_fail(err, SH_ENOMEM, "%s: no memory to write it", path);
    }
    int rc = newfile_part(file->path, file->part, &file->fd, err);
    if (rc != 0) {
        file->fd = -1;
        release(file);
    }
    return rc;
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

int outfile_close(struct outfile *file, int keep, struct sh_err *err)
{
    int rc = keep ? outfile_flush(file, err) : 0;
    if (keep && rc == 0)
        rc = newfile_keep(file->path, file->part, file->fd, err);
    else
        newfile_drop(file->part, file->fd);
    release(file);
    return rc;
}
