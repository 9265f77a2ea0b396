/* SPDX-License-Identifier: MIT */
#include "core/studio/mesh/assimp_files.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/stat.h>

/* Assimp's callbacks carry a char pointer. */
static struct mesh_file *file_of(struct aiFile *handle)
{
    return (struct mesh_file *)(void *)handle->UserData;
}

static size_t on_write(struct aiFile *handle, const char *data, size_t size, size_t count)
{
    return fwrite(data, size, count, file_of(handle)->file);
}

static size_t on_read(struct aiFile *handle, char *data, size_t size, size_t count)
{
    return fread(data, size, count, file_of(handle)->file);
}

static size_t on_tell(struct aiFile *handle)
{
    return (size_t)ftello(file_of(handle)->file);
}

static size_t on_size(struct aiFile *handle)
{
    FILE *file = file_of(handle)->file;
    const off_t at = ftello(file);
    fseeko(file, 0, SEEK_END);
    const off_t end = ftello(file);
    fseeko(file, at, SEEK_SET);
    return (size_t)end;
}

static enum aiReturn on_seek(struct aiFile *handle, size_t offset, enum aiOrigin origin)
{
    const int whence = origin == aiOrigin_SET ? SEEK_SET : origin == aiOrigin_CUR ? SEEK_CUR : SEEK_END;
    return fseeko(file_of(handle)->file, (off_t)offset, whence) == 0 ? aiReturn_SUCCESS : aiReturn_FAILURE;
}

static void on_flush(struct aiFile *handle)
{
    fflush(file_of(handle)->file);
}

static int open_file(struct exporter *e, const char *path)
{
    char *raw = NULL;
    if (e->n_files == ASSIMP_FILES)
        return sh_fail(&e->err, SH_EIO, "%s: the exporter writes more than %d files", e->out->path, ASSIMP_FILES);
    if (e->is_raw && asprintf(&raw, "%s.raw", path) < 0)
        return sh_fail(&e->err, SH_ENOMEM, "%s: no memory to write it", e->out->path);
    int rc = mesh_output_open(e->out, raw != NULL ? raw : path, &e->file[e->n_files], &e->err);
    free(raw);
    return rc;
}

struct aiFile *assimp_open(struct aiFileIO *io, const char *path, const char *mode)
{
    struct exporter *e = (struct exporter *)(void *)io->UserData;
    if (e->rc != SH_OK || strchr(mode, 'w') == NULL) return NULL;
    e->rc = open_file(e, path);
    if (e->rc != SH_OK) return NULL;
    struct aiFile *handle = &e->handle[e->n_files];
    *handle = (struct aiFile){on_read, on_write, on_tell, on_size, on_seek, on_flush, NULL};
    handle->UserData = (char *)(void *)e->file[e->n_files++];
    return handle;
}

/* What is written is kept or dropped at the end. */
void assimp_close(struct aiFileIO *io, struct aiFile *handle)
{
    (void)io;
    fflush(file_of(handle)->file);
}

/* Finds writes that failed: Assimp itself does not check them, or gives no reason. */
int assimp_check_files(struct exporter *e, struct sh_err *err)
{
    int rc = SH_OK;
    for (int i = 0; i < e->n_files && rc == SH_OK; i++)
        rc = mesh_file_check(e->file[i], err);
    return rc;
}

/* The file as it is to be, from what was exported. */
int assimp_copy_raw(struct exporter *e, struct sh_err *err)
{
    struct mesh_file *to, *raw = e->file[0];
    struct stat st;
    if (fstat(raw->fd, &st) != 0)
        return sh_fail(err, SH_EIO, "%s: cannot be read back: %s", raw->part, strerror(errno));
    const size_t n = (size_t)st.st_size;
    uint8_t *data = n > 0 ? mmap(NULL, n, PROT_READ, MAP_PRIVATE, raw->fd, 0) : MAP_FAILED;
    if (data == MAP_FAILED) return sh_fail(err, SH_EIO, "%s: cannot be read back", raw->part);
    int rc = mesh_output_open(e->out, e->out->path, &to, err);
    if (rc == SH_OK) rc = mesh_fbx_copy(data, n, to, err);
    munmap(data, n);
    if (rc == SH_OK) mesh_output_drop(e->out, raw);
    return rc;
}
