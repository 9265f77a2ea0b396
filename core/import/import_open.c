/* SPDX-License-Identifier: MIT */
#include "core/import/import_open.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "core/infile.h"

static FILE *stream_of(struct aiFile *file)
{
    return (FILE *)(void *)file->UserData;
}

static size_t on_read(struct aiFile *file, char *data, size_t size, size_t count)
{
    return fread(data, size, count, stream_of(file));
}

static size_t on_write(struct aiFile *file, const char *data, size_t size, size_t count)
{
    return fwrite(data, size, count, stream_of(file));
}

static size_t on_tell(struct aiFile *file)
{
    return (size_t)ftello(stream_of(file));
}

static size_t on_size(struct aiFile *file)
{
    const off_t at = ftello(stream_of(file));
    fseeko(stream_of(file), 0, SEEK_END);
    const off_t end = ftello(stream_of(file));
    fseeko(stream_of(file), at, SEEK_SET);
    return end > 0 ? (size_t)end : 0;
}

static enum aiReturn on_seek(struct aiFile *file, size_t offset, enum aiOrigin origin)
{
    const int whence = origin == aiOrigin_SET ? SEEK_SET : origin == aiOrigin_CUR ? SEEK_CUR : SEEK_END;
    return fseeko(stream_of(file), (off_t)offset, whence) == 0 ? aiReturn_SUCCESS : aiReturn_FAILURE;
}

static void on_flush(struct aiFile *file)
{
    fflush(stream_of(file));
}

struct aiFile import_open_stream(FILE *stream)
{
    return (struct aiFile){on_read, on_write, on_tell, on_size, on_seek, on_flush, (char *)(void *)stream};
}

/* Opens a file to read. Assimp also asks for names that need not exist, so a missing file is not noted as refused. */
static struct aiFile *on_open(struct aiFileIO *io, const char *path, const char *mode)
{
    struct import_open *open = (struct import_open *)(void *)io->UserData;
    const char *why;
    if (strchr(mode, 'r') == NULL) return NULL;
    const bool is_changed = open->instead.p != NULL && strcmp(path, open->path) == 0;
    FILE *stream =
        is_changed ? fmemopen((char *)(uintptr_t)open->instead.p, open->instead.n, "r") : infile_open(path, &why);
    if (stream == NULL && !is_changed && open->refused[0] == '\0' && access(path, F_OK) == 0)
        snprintf(open->refused, sizeof open->refused, "%.300s: %s", path, why);
    if (stream == NULL) return NULL;
    struct aiFile *file = malloc(sizeof *file);
    if (file == NULL) {
        fclose(stream);
        return NULL;
    }
    *file = import_open_stream(stream);
    return file;
}

static void on_close(struct aiFileIO *io, struct aiFile *file)
{
    (void)io;
    fclose(stream_of(file));
    free(file);
}

void import_open_set_up(struct import_open *open, const char *path, struct text_span instead)
{
    *open = (struct import_open){.io = {on_open, on_close, NULL}, .path = path, .instead = instead};
    open->io.UserData = (char *)(void *)open;
}
