#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "core/mesh/inside.h"
#include "core/newfile.h"

enum { BUFFER = 1 << 18, STEPS_BETWEEN_STOPS = 1 << 16 };

static int fail_write(const struct mesh_file *file, struct sh_err *err)
{
    return sh_fail(err, SH_EIO, "%s: cannot write: %s", file->part, strerror(errno));
}

static void release(struct mesh_file *file)
{
    free(file->path);
    free(file->part);
    memset(file, 0, sizeof *file);
}

int mesh_file_open(struct mesh_file *file, const char *path, struct sh_err *err)
{
    memset(file, 0, sizeof *file);
    file->path = strdup(path);
    if (file->path == NULL || asprintf(&file->part, "%s.part", path) < 0) {
        file->part = NULL;
        release(file);
        return sh_fail(err, SH_ENOMEM, "%s: no memory to write it", path);
    }
    int rc = newfile_part(file->path, file->part, &file->fd, err);
    if (rc != SH_OK) {
        release(file);
        return rc;
    }
    int fd = dup(file->fd);
    file->file = fd >= 0 ? fdopen(fd, "w+b") : NULL;
    if (file->file != NULL) {
        setvbuf(file->file, NULL, _IOFBF, BUFFER);
        return SH_OK;
    }
    fail_write(file, err);
    if (fd >= 0) close(fd);
    newfile_drop(file->part, file->fd);
    release(file);
    return SH_EIO;
}

int mesh_file_write(struct mesh_file *file, const void *data, size_t len, struct sh_err *err)
{
    return fwrite(data, 1, len, file->file) == len ? SH_OK : fail_write(file, err);
}

int mesh_file_close(struct mesh_file *file, int keep, struct sh_err *err)
{
    const int failed = ferror(file->file);
    int rc = SH_OK;
    if ((fclose(file->file) != 0 || failed) && keep) rc = fail_write(file, err);
    if (keep && rc == SH_OK)
        rc = newfile_keep(file->path, file->part, file->fd, err);
    else
        newfile_drop(file->part, file->fd);
    release(file);
    return rc;
}

int mesh_work_step(struct mesh_work *work, struct sh_err *err)
{
    if (++work->done % STEPS_BETWEEN_STOPS != 0) return SH_OK;
    sh_progress(work->report, work->what, (double)work->done / (double)work->all);
    return sh_check_stop(work->report, err);
}

/* Up to 9e6 a double times 1e9 is a whole number of at most 53 bits and a part, so that it is rounded once, and rightly but
 * for ties. Beyond, double itself steps by more than a nanometre. */
size_t mesh_put_number(char *to, double v)
{
    char digit[20], *p = to;
    int n = 0, skip = 0;
    if (fabs(v) > 9e6) return (size_t)snprintf(to, MESH_NUMBER_LEN, "%.17g", v);
    uint64_t left = (uint64_t)llrint(fabs(v) * 1e9);
    if (v < 0 && left != 0) *p++ = '-';
    while (left > 0 || n < 10) {
        digit[n++] = (char)('0' + left % 10);
        left /= 10;
    }
    while (skip < 9 && digit[skip] == '0')
        skip++;
    for (int i = n - 1; i >= 9; i--)
        *p++ = digit[i];
    if (skip < 9) *p++ = '.';
    for (int i = 8; i >= skip; i--)
        *p++ = digit[i];
    *p = '\0';
    return (size_t)(p - to);
}

const char *mesh_stem(const char *path, size_t *len)
{
    const char *slash = strrchr(path, '/'), *name = slash != NULL ? slash + 1 : path, *dot = strrchr(name, '.');
    *len = dot != NULL && dot != name ? (size_t)(dot - name) : strlen(name);
    return name;
}

char *mesh_beside(const char *path, const char *ending)
{
    size_t len;
    const char *name = mesh_stem(path, &len);
    char *other;
    return asprintf(&other, "%.*s%s", (int)((size_t)(name - path) + len), path, ending) < 0 ? NULL : other;
}
