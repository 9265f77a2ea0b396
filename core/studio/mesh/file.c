/* SPDX-License-Identifier: MIT */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "core/decimal.h"
#include "core/direct.h"
#include "core/grow.h"
#include "core/studio/mesh/inside.h"
#include "core/newfile.h"

enum { BUFFER = 1 << 20, STEPS_BETWEEN_STOPS = 1 << 16 };

static int fail_write(const struct mesh_file *file, struct sh_err *err)
{
    const int error = file->error != 0 ? file->error : EIO;
    const int is_full = error == ENOSPC || error == EDQUOT || error == EFBIG;
    return sh_fail(err, SH_EIO, "%s: cannot write: %s%s", file->part, strerror(error),
                   is_full ? ": make room, or write to another disk; nothing of it is kept" : "");
}

/* ---- a stream that remembers why a write failed. The stream seems to take all later bytes, since Assimp's exporter of
 * FBX ends the whole program where the stream's position does not move with a write. */

/* Returns whether the bytes are full, aligned buffers of a file that is long already. Such buffers can be written past
 * the system's cache. */
static int is_full_buffer(const struct mesh_file *file, const char *data, size_t n)
{
    return file->at >= DIRECT_FROM && (uintptr_t)data % DIRECT_BLOCK == 0 && n % DIRECT_BLOCK == 0 &&
           file->at % DIRECT_BLOCK == 0;
}

static ssize_t on_write(void *cookie, const char *data, size_t n)
{
    struct mesh_file *file = cookie;
    direct_set(file->fd, &file->is_direct, is_full_buffer(file, data, n));
    for (size_t done = 0; done < n && file->error == 0;) {
        const ssize_t wrote = direct_pwrite(file->fd, &file->is_direct, data + done, n - done, file->at + (off_t)done);
        if (wrote < 0) file->error = errno;
        if (wrote > 0) done += (size_t)wrote;
    }
    file->at += (off_t)n;
    if (file->at > file->end) file->end = file->at;
    return (ssize_t)n;
}

static ssize_t on_read(void *cookie, char *data, size_t n)
{
    struct mesh_file *file = cookie;
    direct_set(file->fd, &file->is_direct, 0);
    const ssize_t got = pread(file->fd, data, n, file->at);
    if (got > 0) file->at += got;
    return got;
}

static int on_seek(void *cookie, off64_t *at, int whence)
{
    struct mesh_file *file = cookie;
    const off_t to = *at + (whence == SEEK_SET ? 0 : whence == SEEK_CUR ? file->at : file->end);
    if (to < 0) return -1;
    *at = file->at = to;
    return 0;
}

static int open_stream(struct mesh_file *file, struct sh_err *err)
{
    file->file = fopencookie(file, "w+b", (cookie_io_functions_t){on_read, on_write, on_seek, NULL});
    file->buffer = aligned_alloc(DIRECT_BLOCK, BUFFER);
    if (file->file == NULL || file->buffer == NULL)
        return sh_fail(err, SH_ENOMEM, "%s: no memory to write it", file->path);
    setvbuf(file->file, file->buffer, _IOFBF, BUFFER);
    return SH_OK;
}

/* ---- one file */

static void release(struct mesh_file *file)
{
    if (file->file != NULL) fclose(file->file);
    if (file->fd >= 0) close(file->fd);
    free(file->buffer);
    free(file->path);
    free(file->part);
    free(file);
}

static int open_file(struct mesh_file *file, const char *path, struct sh_err *err)
{
    file->path = strdup(path);
    if (file->path == NULL || asprintf(&file->part, "%s.part", path) < 0) {
        file->part = NULL;
        return sh_fail(err, SH_ENOMEM, "%s: no memory to write it", path);
    }
    int fd, rc = newfile_part(file->path, file->part, &fd, err);
    if (rc != SH_OK) return rc;
    file->fd = fd;
    rc = open_stream(file, err);
    if (rc != SH_OK) unlink(file->part);
    return rc;
}

int mesh_file_write(struct mesh_file *file, const void *data, size_t len, struct sh_err *err)
{
    return fwrite(data, 1, len, file->file) == len && file->error == 0 ? SH_OK : fail_write(file, err);
}

int mesh_file_check(struct mesh_file *file, struct sh_err *err)
{
    return fflush(file->file) == 0 && file->error == 0 && !ferror(file->file) ? SH_OK : fail_write(file, err);
}

int mesh_file_finish(struct mesh_file *file, struct sh_err *err)
{
    int rc = mesh_file_check(file, err);
    if (rc == SH_OK) rc = newfile_sync(file->part, file->fd, err);
    if (rc != SH_OK) return rc;
    fclose(file->file);
    close(file->fd);
    file->file = NULL;
    file->fd = -1;
    return SH_OK;
}

/* ---- the files of one output */

int mesh_output_open(struct mesh_output *out, const char *path, struct mesh_file **file, struct sh_err *err)
{
    struct mesh_file *f =
        grow(&out->file, &out->room, out->n + 1, sizeof(struct mesh_file *)) ? calloc(1, sizeof *f) : NULL;
    if (f == NULL) return sh_fail(err, SH_ENOMEM, "%s: no memory to write it", path);
    f->fd = -1;
    const int rc = open_file(f, path, err);
    if (rc != SH_OK) {
        release(f);
        return rc;
    }
    out->file[out->n++] = *file = f;
    return SH_OK;
}

void mesh_output_drop(struct mesh_output *out, struct mesh_file *file)
{
    size_t i = 0;
    while (out->file[i] != file)
        i++;
    out->file[i] = out->file[--out->n];
    unlink(file->part);
    release(file);
}

/* Whether this is the mesh's own file, which is renamed last, after the files that it names. */
static int is_mesh(const struct mesh_output *out, const struct mesh_file *file)
{
    return strcmp(file->path, out->path) == 0;
}

/* Where one file can't get its name, those that have theirs are removed again. */
static int rename_all(struct mesh_output *out, struct sh_err *err)
{
    int rc = SH_OK;
    for (int pass = 0; pass < 2; pass++)
        for (size_t i = 0; i < out->n && rc == SH_OK; i++)
            if (is_mesh(out, out->file[i]) == pass) {
                rc = newfile_rename(out->file[i]->path, out->file[i]->part, err);
                out->file[i]->is_named = rc == SH_OK;
            }
    for (size_t i = 0; i < out->n && rc != SH_OK; i++)
        if (out->file[i]->is_named) unlink(out->file[i]->path);
    return rc;
}

int mesh_output_close(struct mesh_output *out, int keep, struct sh_err *err)
{
    int rc = SH_OK;
    for (size_t i = 0; i < out->n && keep && rc == SH_OK; i++)
        if (out->file[i]->fd >= 0 && !is_mesh(out, out->file[i])) rc = mesh_file_finish(out->file[i], err);
    for (size_t i = 0; i < out->n && keep && rc == SH_OK; i++) /* stays open, and so locked, until the end */
        if (is_mesh(out, out->file[i])) {
            rc = mesh_file_check(out->file[i], err);
            if (rc == SH_OK) rc = newfile_sync(out->file[i]->part, out->file[i]->fd, err);
        }
    if (keep && rc == SH_OK) rc = rename_all(out, err);
    for (size_t i = 0; i < out->n; i++) {
        if (!keep || rc != SH_OK) unlink(out->file[i]->part);
        release(out->file[i]);
    }
    free(out->file);
    return rc;
}

static int put_image(struct mesh_output *out, const struct mesh_part *part, struct sh_err *err)
{
    struct mesh_file *file;
    struct sh_err why = {0};
    char *path;
    if (asprintf(&path, "%.*s%s", (int)(basename(out->path) - out->path), out->path, part->texture) < 0)
        return sh_fail(err, SH_ENOMEM, "%s: no memory to write its texture", out->path);
    int rc = mesh_output_open(out, path, &file, err);
    free(path);
    if (rc != SH_OK) return rc;
    rc = picture_put_png(file->file, part->image, &why);
    if (rc != SH_OK && file->error == 0) return sh_fail(err, rc, "%s: cannot write: %s", file->part, why.text);
    return mesh_file_finish(file, err);
}

int mesh_output_images(struct mesh_output *out, const struct mesh *mesh, struct sh_err *err)
{
    int rc = SH_OK;
    for (uint32_t i = 0; i < mesh->n_parts && rc == SH_OK; i++)
        if (mesh->part[i].image != NULL && mesh->part[i].texture != NULL) rc = put_image(out, &mesh->part[i], err);
    return rc;
}

int mesh_work_step(struct mesh_work *work, struct sh_err *err)
{
    if (++work->done % STEPS_BETWEEN_STOPS != 0) return SH_OK;
    sh_progress(work->report, work->what, (double)work->done / (double)work->all);
    return sh_check_stop(work->report, err);
}

/* Up to 9e6, the product with 1e9 has a whole part of at most 53 bits: it is rounded rightly, but for ties. Beyond,
 * double itself steps by more than a nanometre. */
char *mesh_put_number(char *to, double v)
{
    if (fabs(v) > 9e6) return decimal_put_general(to, v, 17);
    const uint64_t nm = (uint64_t)llrint(fabs(v) * 1e9);
    *to = '-';
    return decimal_put_short(to + (v < 0 && nm != 0), nm, 9);
}

void mesh_put_line(FILE *out, const char *key, const char *text)
{
    fputs(key, out);
    for (; *text != '\0'; text++)
        fputc((unsigned char)*text < 0x20 || *text == 0x7f ? '?' : *text, out);
    fputc('\n', out);
}

const char *mesh_stem(const char *path, size_t *len)
{
    const char *name = basename(path), *dot = strrchr(name, '.');
    *len = dot != NULL && dot != name ? (size_t)(dot - name) : strlen(name);
    return name;
}

char *mesh_with_ending(const char *path, const char *ending)
{
    size_t len;
    const char *name = mesh_stem(path, &len);
    char *other;
    return asprintf(&other, "%.*s%s", (int)((size_t)(name - path) + len), path, ending) < 0 ? NULL : other;
}
