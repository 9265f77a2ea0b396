/* SPDX-License-Identifier: MIT */
/* Private to core/import/read_ply*.c: a PLY mesh while it is read. */
#ifndef CORE_IMPORT_READ_PLY_H
#define CORE_IMPORT_READ_PLY_H

#include "core/ply.h"
#include "core/import/readers.h"
#include "core/scene/weld.h"

/* A vertex that is not finite. */
struct ply_lost {
    uint32_t number; /* from 0 */
    uint64_t line;
    double v[3];
};

struct ply {
    struct scene_build *b;
    struct ply_rows r;
    uint16_t label;         /* of the next face */
    struct build_weld weld; /* number NULL: vertices are not merged */
    struct ply_lost *lost;  /* in the order of the file */
    size_t n_lost, cap_lost;
    uint64_t n_empty; /* faces without corners */
    /* ---- read_ply_colours.c */
    struct ply_colour {
        float rgb[3], uv[2]; /* as in the file. Without colours rgb is 0; without coordinates uv is NaN. */
    } * colour;              /* of each vertex, where colours or texture coordinates are wanted and there */
    size_t n_colours, cap_colours;
    double rgb_scale;  /* of colours of vertices; 0: not known yet */
    double face_scale; /* of those of faces */
    /* has_vertex_uv and has_texnumbers say only what the file has. The other flags also say that it is wanted. */
    bool has_vertex_rgb;               /* colours of vertices */
    bool has_face_rgb;                 /* colours of faces, in the element at hand */
    bool has_uv;                       /* texture coordinates, by vertex, face or both */
    bool has_vertex_uv, has_texcoords; /* by vertex; by face, in the row at hand, a pair for each corner */
    bool has_texnumbers;
    bool has_label[PLY_MAX_TEXTURES + 1];
    uint16_t labels[PLY_MAX_TEXTURES + 1]; /* by texture; the last one: of faces without a texture */
    uint16_t texture[PLY_MAX_TEXTURES];    /* their numbers in the scene, 0: unused */
    char *texture_name[PLY_MAX_TEXTURES];
    uint64_t n_unfit; /* faces with another number of texture coordinates than corners */
};

/* Before any row: finds the textures, and those that are missing. */
int ply_begin_textures(struct ply *y, struct sh_err *err);
/* Before the rows of an element: sets has_face_rgb and face_scale for it. */
void ply_begin_colours(struct ply *y);
int ply_keep_vertex_colour(struct ply *y, struct sh_err *err);
/* Sets the row's label, has_rgb and has_uv. */
int ply_begin_face(struct ply *y, struct sh_err *err);
/* Gives corner `to` of the polygon the colour and texture coordinates of the row's corner `from`. vertex: the
 * number of the vertex at that corner. */
void ply_set_corner_colour(struct ply *y, size_t to, size_t from, uint32_t vertex);
void ply_end_textures(struct ply *y);
void ply_free_colours(struct ply *y);

#endif
