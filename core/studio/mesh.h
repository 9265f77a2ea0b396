/* SPDX-License-Identifier: MIT */
/* Meshes to files: vertices and triangles in, one file out, and the files that it names. The ending chooses the
 * format: .ply, .obj, .gltf, .glb, .fbx.
 *
 * Units and frames: metres, z up, right-handed. In the formats:
 *   .ply   binary, little-endian: coordinates as double. As text: to the nanometre.
 *   .obj   coordinates to the nanometre; z up (the format has neither unit nor axes). Where the mesh or a part of it
 *          has a texture, NAME.mtl is written, too.
 *   .gltf, .glb  float; metres and y up, as the format demands: (x, y, z) is written as (x, z, -y). Colours are linear
 *          there, and left out where a texture is. .gltf has its numbers in NAME.bin beside it, .glb all it
 *          needs within.
 *          Vertices nearer to each other than 10 micrometres that agree in all else may become one.
 *   .fbx   binary, float; z up and metres, and its header says so (UpAxis 2, UnitScaleFactor 100).
 * Rounding to float moves a coordinate by up to 6e-8 of it, half a step. Where that is more than MESH_FLOAT_PART of the
 * mesh's size (and more than 1 micrometre), the mesh is refused with the figures: nothing is moved to the origin in
 * silence.
 *
 * Ownership: all arrays are the caller's and are not changed. .gltf, .glb and .fbx take about 500 bytes of memory a
 * face while they are written. Not real-time safe; any thread, one file each. */
#ifndef CORE_STUDIO_MESH_H
#define CORE_STUDIO_MESH_H

#include <stdint.h>

#include "core/err.h"

struct picture; /* core/studio/picture.h */

#define MESH_FLOAT_PART 1e-6
enum {
    MESH_MAX_VERTICES = INT32_MAX, /* PLY's indices, and those of its readers, are int */
    MESH_MAX_PARTS = 65535,
    MESH_NAME_LEN = 256,
};

/* The type of a figure, in memory and in the file. */
enum mesh_type { MESH_DOUBLE, MESH_FLOAT, MESH_UINT16 };

/* A figure for each vertex, in .ply only. value: [n_vertices] of double, float or uint16_t, as type says. */
struct mesh_scalar {
    const char *name; /* of the property: a word */
    const void *value;
    enum mesh_type type;
};

/* A range of vertices and of faces, which use these vertices alone: an object of .obj, .gltf, .glb and .fbx. In .ply
 * parts don't show. */
struct mesh_part {
    const char *name; /* without control characters */
    uint32_t n_vertices, n_faces;
    const char *texture; /* as mesh.texture */
    /* The image itself, written beside the file under that name, or into a .glb. NULL: the caller writes it. */
    const struct picture *image;
};

struct mesh {
    uint32_t n_vertices, n_faces;
    const double (*xyz_m)[3]; /* [n_vertices] */
    const float (*normal)[3]; /* [n_vertices] unit vectors; NULL: none */
    const uint8_t (*rgb)[3];  /* [n_vertices] sRGB; NULL: none */
    const float (*uv)[2]; /* [n_vertices] 0, 0 is the image's lower left corner; in .ply they are s, t; NULL: none */
    /* [n_faces] indices of vertices, counter-clockwise seen from outside; NULL: points alone */
    const uint32_t (*face)[3];
    const uint8_t (*face_rgb)[3];     /* [n_faces] of .ply alone; NULL: none */
    const struct mesh_scalar *scalar; /* [n_scalars] */
    uint32_t n_scalars;
    const char *const *comment; /* [n_comments] lines for the header of .ply and .obj */
    uint32_t n_comments;
    const char *texture;          /* name of the image that uv are of, as the file's reader finds it; NULL: none */
    const struct mesh_part *part; /* [n_parts] one after the other, all vertices and all faces; then texture is NULL */
    uint32_t n_parts;             /* 0: one, named as the file, or "mesh" in .gltf, .glb and .fbx */
    int ascii;                    /* .ply as text */
};

/* Returns 1 where the ending is that of a format that this module writes. */
int mesh_has_format(const char *path);

/* Returns 1 where the ending is that of a format for points without faces: .ply and .obj. */
int mesh_takes_points(const char *path);

/* Returns 1 where the ending is that of a format whose coordinates are float. */
int mesh_is_float(const char *path);

/* SH_EINPUT where the ending is of a format of floats that can't hold coordinates between low and high, with the
 * figures and what to do. For an early refusal; mesh_write checks the same. */
int mesh_check_box(const char *path, const double low[3], const double high[3], struct sh_err *err);

/* SH_EINPUT where a mesh can't name its other files because of its own name: in a .gltf that is no UTF-8 or has
 * characters of URIs, in an .obj with control characters. For an early refusal; mesh_write checks the same. */
int mesh_check_name(const char *path, struct sh_err *err);

/* Writes the mesh and the files that it names, all or none (core/newfile.h): all are written as NAME.part, and once all
 * are complete they are renamed, the mesh last. Where one can't be written, none is left. SH_EINPUT: an unknown ending,
 * with the known ones; a number that is not finite; a mesh that the format can't hold. SH_ESTOPPED where report asks to
 * stop. report also gets the progress of a write that takes more than a second. */
int mesh_write(const char *path, const struct mesh *mesh, const struct sh_report *report, struct sh_err *err);

#endif
