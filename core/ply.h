/* SPDX-License-Identifier: MIT */
/* Reading PLY files, as meshes (core/import/read_ply.c) or points (core/studio/analysis/cloud_ply.c): text, or binary
 * of either byte order, with numbers of any type. In: a file. Out: its elements, and their rows one after the
 * other as doubles.
 *
 * Order of calls: ply_open, ply_walk, ply_close. */
#ifndef CORE_PLY_H
#define CORE_PLY_H

#include "core/bytes.h"
#include "core/text.h"

enum { PLY_MAX_ELEMENTS = 16, PLY_MAX_PROPERTIES = 512, PLY_MAX_TEXTURES = 256 };

enum ply_format { PLY_ASCII, PLY_LITTLE, PLY_BIG };

/* The use of a property. */
enum ply_use {
    PLY_SKIP,
    PLY_X, /* of vertices, as the others up to PLY_SCALARS; colours and texnumber also of faces */
    PLY_Y,
    PLY_Z,
    PLY_STATION,
    PLY_ECHO,
    PLY_LABEL,
    PLY_TIME,
    PLY_RANGE,
    PLY_REFLECTANCE,
    PLY_ECHO_COUNT,
    PLY_AMPLITUDE,
    PLY_RED,
    PLY_GREEN,
    PLY_BLUE,
    PLY_U, /* texture coordinates */
    PLY_V,
    PLY_TEXNUMBER,
    PLY_SCALARS,
    PLY_CORNERS = PLY_SCALARS, /* lists of a face: its vertices, or those of strips */
    PLY_TEXCOORDS              /* u and v of each corner */
};

struct ply_property {
    enum number_type type, count_type;
    bool is_list;
    enum ply_use use;
};

enum ply_kind { PLY_OTHER, PLY_VERTEX, PLY_FACE, PLY_STRIPS /* of triangles; -1 ends one */ };

struct ply_element {
    char name[32];
    enum ply_kind kind;
    uint64_t count;
    int first, n_properties; /* in property[] */
};

struct ply_header {
    enum ply_format format;
    int n_elements, n_properties;
    struct ply_element element[PLY_MAX_ELEMENTS];
    struct ply_property property[PLY_MAX_PROPERTIES];
    /* names in lines "comment TextureFile", valid until rows are read */
    int n_textures;
    struct text_span texture[PLY_MAX_TEXTURES];
    uint64_t texture_line[PLY_MAX_TEXTURES];
};

/* The numbers of a list. */
struct ply_list {
    double *value;
    size_t n, cap;
};

extern const char *const ply_scalar_name[PLY_SCALARS]; /* in the file, by ply_use from PLY_X on */

/* Called by ply_open alone. Leaves t at the first byte of data. Fails where vertices lack x, y or z; faces may lack
 * their list. */
int ply_read_header(struct ply_header *h, struct text *t, struct sh_err *err);

/* The element's property of that use, or NULL. */
const struct ply_property *ply_find(const struct ply_header *h, const struct ply_element *e, enum ply_use use);

struct ply_rows {
    struct text t;
    struct ply_header h;
    const struct ply_element *element; /* being read */
    uint64_t row;                      /* of it, from 0 */
    double scalar[PLY_SCALARS];        /* of the row, by ply_use; [PLY_SKIP] has no meaning */
    struct ply_list corners, texcoords;
    bool is_single; /* x, y or z of vertices is a float of a binary file: its writer has rounded it */
    bool is_kept;   /* bytes before t.p are read again, since faces come before their vertices */
    text_progress *progress;
    void *progress_ctx;
};

/* Opens the file and reads the header; path has to stay. progress is called now (fraction -1: unknown) and by
 * ply_walk. ply_close is due in any case. */
int ply_open(struct ply_rows *r, const char *path, text_progress *progress, void *ctx, struct sh_err *err);
void ply_close(struct ply_rows *r);

/* The user of the rows. */
struct ply_user {
    void *ctx;
    int (*begin)(void *ctx, struct sh_err *err); /* before the rows of r->element, whose count fits into the file */
    int (*row)(void *ctx, struct sh_err *err);   /* after each row, which is in r; row r->row of the element */
    const struct sh_report *report;              /* gets warnings */
    bool has_faces;                              /* faces and strips are used, not passed over */
};

/* Reads all rows in the order of the file, but faces after the vertices. Warns of elements that nobody uses, and of
 * bytes after the last row. */
int ply_walk(struct ply_rows *r, const struct ply_user *user, struct sh_err *err);

/* Fails with "FILE, line L: ELEMENT N of M: what"; for a binary with "FILE: ELEMENT N of M, byte B: what". */
int ply_fail(const struct ply_rows *r, struct sh_err *err, const char *what);

/* The line of a text, 0 in a binary. */
uint64_t ply_line(const struct ply_rows *r);

#endif
