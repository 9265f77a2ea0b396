/* The rows of a PLY file, in file order: numbers of any type, text or binary of either byte order. What they
 * mean is the reader's affair (read_ply.c: a mesh; core/analysis/cloud.c: points). */
#ifndef CORE_SCENE_PLY_ROWS_H
#define CORE_SCENE_PLY_ROWS_H

#include "core/scene/ply_header.h"

struct ply_rows {
    struct text t;
    struct ply_header h;
    const struct ply_element *element; /* being read */
    uint64_t row;                      /* of it, from 0 */
    double scalar[PLY_SCALARS];        /* of the row, by ply_use; [PLY_SKIP] is rubbish */
    double *corner;                    /* the list of use PLY_CORNERS */
    size_t n_corners, cap_corners;
};

/* Opens the file and reads the header; path has to stay. ply_rows_close is due in any case. */
int ply_rows_open(struct ply_rows *r, const char *path, void (*tick)(void *ctx), void *ctx, struct sh_err *err);
void ply_rows_close(struct ply_rows *r);

/* Goes to element i, which has to follow the one before; fails when the rest of the file can't hold its rows.
 */
int ply_rows_begin(struct ply_rows *r, int i, struct sh_err *err);

/* Reads row r->row; counting on is the caller's. */
int ply_rows_read(struct ply_rows *r, struct sh_err *err);

/* Fails with "FILE, line L: ELEMENT N of M: what", or the byte instead of the line in a binary. */
int ply_rows_fail(const struct ply_rows *r, struct sh_err *err, const char *what);

/* The line of a text, 0 in a binary. */
uint64_t ply_rows_line(const struct ply_rows *r);

/* How much of the file is read, 0..1. */
double ply_rows_fraction(const struct ply_rows *r);

/* Bytes after the last row, blank lines of a text aside. */
size_t ply_rows_left_over(struct ply_rows *r);

#endif
