/* SPDX-License-Identifier: MIT */
#include "core/studio/mesh/assimp_files.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/stat.h>

#include "core/import/import_open.h"

static int open_file(struct exporter *e, const char *path)
{
    char *other = NULL;
    if (e->n_files == ASSIMP_FILES)
        return sh_fail(&e->err, SH_EIO, "%s: the exporter writes more than %d files", e->out->path, ASSIMP_FILES);
    if (asprintf(&other, "%s%s", path, e->is_raw ? ".raw" : "") < 0)
        return sh_fail(&e->err, SH_ENOMEM, "%s: no memory to write it", e->out->path);
    if (e->is_uri) mesh_uri_undo(other);
    int rc = mesh_output_open(e->out, other, &e->file[e->n_files], &e->err);
    free(other);
    return rc;
}

struct aiFile *assimp_open(struct aiFileIO *io, const char *path, const char *mode)
{
    struct exporter *e = (struct exporter *)(void *)io->UserData;
    if (e->rc != SH_OK || strchr(mode, 'w') == NULL) return NULL;
    e->rc = open_file(e, path);
    if (e->rc != SH_OK) return NULL;
    e->handle[e->n_files] = import_open_stream(e->file[e->n_files]->file);
    return &e->handle[e->n_files++];
}

/* The file itself stays open. mesh_output_close renames or removes it. */
void assimp_close(struct aiFileIO *io, struct aiFile *handle)
{
    (void)io;
    handle->FlushProc(handle);
}

/* Finds writes that failed: Assimp itself does not check them, or gives no reason. */
int assimp_check_files(struct exporter *e, struct sh_err *err)
{
    int rc = SH_OK;
    for (int i = 0; i < e->n_files && rc == SH_OK; i++)
        rc = mesh_file_check(e->file[i], err);
    return rc;
}

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
