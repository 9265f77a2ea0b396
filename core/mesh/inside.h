/* What the formats of this room share: a file that is being written, and the table of formats. */
#ifndef CORE_MESH_INSIDE_H
#define CORE_MESH_INSIDE_H

#include <stdio.h>

#include "core/mesh.h"

/* A file that appears whole or not at all, written through a buffer. */
struct mesh_file {
    char *path, *part;
    int fd;
    FILE *file;
};

/* Errors name the path. mesh_file_close is due once it has succeeded. */
int mesh_file_open(struct mesh_file *file, const char *path, struct sh_err *err);
int mesh_file_write(struct mesh_file *file, const void *data, size_t len, struct sh_err *err);
/* keep: flushes, syncs, renames. Else, and where that fails, nothing is left. */
int mesh_file_close(struct mesh_file *file, int keep, struct sh_err *err);

/* Copies a binary FBX file as Assimp exports it, with what is missing in it. SH_EIO: it is not one. */
int mesh_fbx_copy(const uint8_t *raw, size_t n_raw, struct mesh_file *to, struct sh_err *err);

/* Long work: what is done of it. Reports and asks for a stop every 65536 steps. */
struct mesh_work {
    const struct sh_report *report;
    char what[96];
    uint64_t done, all;
};
int mesh_work_step(struct mesh_work *work, struct sh_err *err);

/* A coordinate in metres as decimals to the nanometre, without zeros at its end. At least MESH_NUMBER_LEN bytes. */
enum { MESH_NUMBER_LEN = 336 };
size_t mesh_put_number(char *to, double v);

/* The path's name without folders; its length without the ending. */
const char *mesh_stem(const char *path, size_t *len);
/* The path with another ending; free it. NULL: no memory. */
char *mesh_beside(const char *path, const char *ending);

struct mesh_format {
    const char *ending;
    int is_float, takes_points;
    const char *exporter; /* Assimp's name of the format */
    int (*write)(const struct mesh_format *format, const char *path, const struct mesh *mesh, struct mesh_work *work,
                 struct sh_err *err);
};
int mesh_write_ply(const struct mesh_format *format, const char *path, const struct mesh *mesh, struct mesh_work *work,
                   struct sh_err *err);
int mesh_write_obj(const struct mesh_format *format, const char *path, const struct mesh *mesh, struct mesh_work *work,
                   struct sh_err *err);
int mesh_write_assimp(const struct mesh_format *format, const char *path, const struct mesh *mesh,
                      struct mesh_work *work, struct sh_err *err);

#endif
