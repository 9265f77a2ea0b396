/* SPDX-License-Identifier: MIT */
/* Assimp opens files through these functions while it imports: the mesh, and the files that the mesh names (buffers of
 * a glTF, ...). Only regular files are opened, as in core/infile.h: opening a FIFO would wait. */
#ifndef CORE_IMPORT_IMPORT_OPEN_H
#define CORE_IMPORT_IMPORT_OPEN_H

#include <assimp/cfileio.h>
#include <stdio.h>

#include "core/text.h"

struct import_open {
    struct aiFileIO io; /* for Assimp; UserData is this struct */
    const char *path;   /* the file that has `instead` for Assimp */
    struct text_span instead;
    char refused[400]; /* the first file that is there and can't be opened, and why; empty: none */
};

/* instead: the text that the file at `path` has for Assimp, without a NUL in it; p NULL: its own. */
void import_open_set_up(struct import_open *open, const char *path, struct text_span instead);
/* Wraps a stream as a file of Assimp, to read or to write (core/studio/mesh). The stream stays the caller's. */
struct aiFile import_open_stream(FILE *stream);

#endif
