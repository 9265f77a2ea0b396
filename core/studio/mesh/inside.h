/* SPDX-License-Identifier: MIT */
/* Private to core/studio/mesh: files that are being written, and the table of formats. */
#ifndef CORE_STUDIO_MESH_INSIDE_H
#define CORE_STUDIO_MESH_INSIDE_H

#include <stdio.h>
#include <sys/types.h>

#include "core/studio/mesh.h"
#include "core/studio/picture.h"

/* A file that is written as PATH.part through a buffer. */
struct mesh_file {
    char *path, *part;
    int fd;        /* -1: it is whole, and on the disk */
    FILE *file;    /* reads, too */
    char *buffer;  /* of file, in whole blocks */
    int is_named;  /* it has its name by now */
    off_t at, end; /* place and length of the stream; a write that fails moves them, too */
    int error;     /* errno of the first write that failed; 0: none */
    int is_direct; /* now the descriptor writes past the system's cache; -1: the file system can't do it */
};

/* The files of one output, which come and go together (file.c). Begins as zeros but for path. */
struct mesh_output {
    const char *path; /* of the mesh: its file is renamed last */
    struct mesh_file **file;
    size_t n, room;
};

/* Errors name the path. mesh_output_close is due in any case; file is the output's. */
int mesh_output_open(struct mesh_output *out, const char *path, struct mesh_file **file, struct sh_err *err);
int mesh_file_write(struct mesh_file *file, const void *data, size_t len, struct sh_err *err);
/* Fails where something of it could not be written, and says why. */
int mesh_file_check(struct mesh_file *file, struct sh_err *err);
/* Writes a complete file to the disk, and closes it. The file gets its name with the others. */
int mesh_file_finish(struct mesh_file *file, struct sh_err *err);
/* Removes this file alone. */
void mesh_output_drop(struct mesh_output *out, struct mesh_file *file);
/* keep: finishes and renames all. Else, and where that fails, nothing is left. */
int mesh_output_close(struct mesh_output *out, int keep, struct sh_err *err);
/* Writes the images of parts into the mesh's folder. */
int mesh_output_images(struct mesh_output *out, const struct mesh *mesh, struct sh_err *err);

/* Copies a binary FBX file of Assimp's exporter, adds the ends of lists that it lacks, and sets the file's time of
 * creation to 1970-01-01 10:00. SH_EIO: raw is not such a file, or the copy can't be written. */
int mesh_fbx_copy(const uint8_t *raw, size_t n_raw, struct mesh_file *to, struct sh_err *err);

/* The progress of long work. mesh_work_step reports it, and asks whether to stop, every 65536 steps. */
struct mesh_work {
    const struct sh_report *report;
    char what[96];
    uint64_t done, all;
};
int mesh_work_step(struct mesh_work *work, struct sh_err *err);

/* Writes a coordinate in metres, in DECIMAL_GENERAL_ROOM bytes (core/decimal.h): up to 9e6 m as decimals to the
 * nanometre, without zeros at its end; beyond, with 17 digits. Returns the end. */
char *mesh_put_number(char *to, double v);

/* Writes one line: the key, which ends with a blank, then the text. Control characters in the text become question
 * marks. */
void mesh_put_line(FILE *out, const char *key, const char *text);

/* Returns the path's name without folders. *len: its length without the ending. */
const char *mesh_stem(const char *path, size_t *len);
/* Returns the path with another ending, which the caller frees. NULL: no memory. */
char *mesh_with_ending(const char *path, const char *ending);

/* Returns the path with the characters of its name that no URI has, such as blanks, as %20 and so on. The caller frees
 * it. NULL: no memory. */
char *mesh_uri_of(const char *path);
/* Turns the %20 and so on of a path from mesh_uri_of back, in place. A name of a .gltf has no % (mesh_check_name). */
void mesh_uri_undo(char *path);

struct mesh_format {
    const char *ending;
    int is_float, takes_points;
    const char *exporter; /* Assimp's name of the format */
    /* Opens and writes out->path and what belongs to it; the caller closes. The mesh has at least one part. */
    int (*write)(const struct mesh_format *format, struct mesh_output *out, const struct mesh *mesh,
                 struct mesh_work *work, struct sh_err *err);
};
int mesh_write_ply(const struct mesh_format *format, struct mesh_output *out, const struct mesh *mesh,
                   struct mesh_work *work, struct sh_err *err);
int mesh_write_obj(const struct mesh_format *format, struct mesh_output *out, const struct mesh *mesh,
                   struct mesh_work *work, struct sh_err *err);
int mesh_write_assimp(const struct mesh_format *format, struct mesh_output *out, const struct mesh *mesh,
                      struct mesh_work *work, struct sh_err *err);

#endif
