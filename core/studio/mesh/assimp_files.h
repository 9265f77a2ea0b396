/* SPDX-License-Identifier: MIT */
/* Private to core/studio/mesh: the files that Assimp's exporter opens. These files belong to one output of ours
 * (inside.h). */
#ifndef CORE_STUDIO_MESH_ASSIMP_FILES_H
#define CORE_STUDIO_MESH_ASSIMP_FILES_H

#include <assimp/cfileio.h>

#include "core/studio/mesh/inside.h"

enum { ASSIMP_FILES = 4 };

struct exporter {
    struct mesh_output *out;
    struct mesh_file *file[ASSIMP_FILES]; /* in the order in which they were opened */
    struct aiFile handle[ASSIMP_FILES];
    int n_files, rc;
    int is_uri; /* the exporter has the path as mesh_uri_of returns it */
    int is_raw; /* the exporter writes NAME.raw.part, of which the file is made */
    struct sh_err err;
    struct aiFileIO io;
};

/* Callbacks for io.OpenProc and io.CloseProc; io.UserData is the exporter, whose out, is_raw and io are set. */
struct aiFile *assimp_open(struct aiFileIO *io, const char *path, const char *mode);
void assimp_close(struct aiFileIO *io, struct aiFile *handle);
/* After the export: fails where something could not be written, and says why. */
int assimp_check_files(struct exporter *exporter, struct sh_err *err);
/* After assimp_check_files, with is_raw: makes the output's file from the raw one that the exporter wrote. */
int assimp_copy_raw(struct exporter *exporter, struct sh_err *err);

#endif
