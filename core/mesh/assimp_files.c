#include "core/mesh/assimp_files.h"

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
        return sh_fail(&e->err, SH_EIO, "%s: the exporter wants more than %d files", e->path, ASSIMP_FILES);
    if (e->is_raw && asprintf(&raw, "%s.raw", path) < 0)
        return sh_fail(&e->err, SH_ENOMEM, "%s: no memory to write it", e->path);
    int rc = mesh_file_open(&e->file[e->n_files], raw != NULL ? raw : path, &e->err);
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
    handle->UserData = (char *)(void *)&e->file[e->n_files++];
    return handle;
}

/* What is written is kept or dropped at the end. */
void assimp_close(struct aiFileIO *io, struct aiFile *handle)
{
    (void)io;
    fflush(file_of(handle)->file);
}

/* The file itself is kept last. */
int assimp_close_files(struct exporter *e, int keep, struct sh_err *err)
{
    int rc = SH_OK;
    for (int pass = 0; pass < 2; pass++)
        for (int i = 0; i < e->n_files; i++) {
            if ((strcmp(e->file[i].path != NULL ? e->file[i].path : "", e->path) == 0) != pass) continue;
            if (e->file[i].path == NULL) continue;
            int closed = mesh_file_close(&e->file[i], keep && rc == SH_OK, err);
            if (rc == SH_OK) rc = closed;
        }
    return rc;
}

/* The file as it is to be, from what was exported. */
int assimp_copy_raw(struct exporter *e, struct sh_err *err)
{
    struct mesh_file to;
    struct stat st;
    FILE *raw = e->file[0].file;
    if (fflush(raw) != 0 || fstat(fileno(raw), &st) != 0)
        return sh_fail(err, SH_EIO, "%s: cannot write: %s", e->file[0].part, strerror(errno));
    const size_t n = (size_t)st.st_size;
    uint8_t *data = n > 0 ? mmap(NULL, n, PROT_READ, MAP_PRIVATE, fileno(raw), 0) : MAP_FAILED;
    if (data == MAP_FAILED) return sh_fail(err, SH_EIO, "%s: cannot be read back", e->file[0].part);
    int rc = mesh_file_open(&to, e->path, err);
    if (rc == SH_OK) {
        rc = mesh_fbx_copy(data, n, &to, err);
        int closed = mesh_file_close(&to, rc == SH_OK, err);
        if (rc == SH_OK) rc = closed;
    }
    munmap(data, n);
    return rc;
}
