/* SPDX-License-Identifier: MIT */
/* How the readers make a scene: vertices and faces go in file by file, in file coordinates, and the builder
 * turns, scales, shifts, checks, cuts polygons up, names surfaces and counts what was left out. */
#ifndef CORE_SCENE_BUILD_H
#define CORE_SCENE_BUILD_H

#include "core/scene.h"
#include "core/scene/build_say.h"
#include "core/scene/triangulate.h"
#include "core/text.h"

enum { SCENE_MAX_CORNERS = 65536 }; /* of one polygon: ear clipping is quadratic */

struct scene_build {
    struct scene *scene;
    double tolerance_m;
    const struct sh_report *report;
    /* of the file being read */
    const struct scene_mesh_spec *spec;
    struct text_span instead;    /* what Assimp reads in place of the file; p NULL: it reads the file */
    char name[128];              /* of the file, for messages; a long path is cut at its front */
    uint64_t line;               /* of a text file, for messages; 0 where there is none */
    const char *mesh;            /* name of the mesh within the file, for messages; may be NULL */
    uint32_t vertex0, triangle0; /* the scene's size before this file */
    uint32_t mesh_vertex0;       /* the scene's size before this mesh; messages count from here */
    uint32_t n_welded;           /* vertices of this file that were there already: build_weld_vertex */
    struct scene_counts counts;
    uint64_t not_simple;
    uint64_t n_rgb_limited; /* colours of corners or vertices beyond their range */
    double rgb_most;        /* the greatest value that their range allows in the file, 1 or 255 */
    /* the next polygon, room by build_corners */
    uint32_t *corner;      /* indices into the scene, which the reader has checked */
    float (*corner_uv)[2]; /* where has_uv: their texture coordinates */
    bool has_uv;
    uint8_t (*corner_rgb)[4]; /* where has_rgb: their colours, as scene->rgb has them */
    bool has_rgb;
    /* the builder's own */
    size_t cap_corners, cap_vertices, cap_triangles, cap_surfaces;
    void *surface_tree; /* of pointers into the scene's surfaces, by name */
    struct triangulate polygon;
    int64_t start_ns, file_ns, reported_ns; /* of the load, of this file, of the last report */
};

/* Makes room for that many more, so that a reader that knows its counts allocates once. */
int build_reserve(struct scene_build *b, uint64_t vertices, uint64_t triangles, struct sh_err *err);

/* Adds a vertex, whose index is scene->n_vertices before the call. v: in the file's units and axes. */
int build_vertex(struct scene_build *b, const double v[3], struct sh_err *err);

/* Makes room for n corners in corner, corner_uv and corner_rgb; their contents stay. */
int build_corners(struct scene_build *b, size_t n, struct sh_err *err);
/* Reverses the order of the n corners, after the first one: the polygon faces the other way. A reader calls it where a
 * transform with a negative determinant has mirrored the polygon, so that the outer side of a body stays its outer
 * side. */
void build_turn_over(struct scene_build *b, size_t n);
/* Adds the polygon of the n >= 3 corners in corner. */
int build_polygon(struct scene_build *b, size_t n, uint16_t label, struct sh_err *err);

#define BUILD_SINGLE_ROUNDING 6e-8 /* 2^-24: largest relative error of rounding to the nearest float */

/* The file's coordinates, up to `largest`, were rounded to single precision, with an error of up to
 * `error`; both in its units. Records the error, and warns of more than a micrometre. With `refuse` it
 * fails where the error is more than allowed. */
int build_single(struct scene_build *b, double largest, double error, bool refuse, struct sh_err *err);

/* Whether texture coordinates and textures are to be read. */
static inline bool build_wants_textures(const struct scene_build *b)
{
    return b->spec->textures || b->spec->cutouts;
}

/* Whether colours of vertices are to be read. */
static inline bool build_wants_colours(const struct scene_build *b)
{
    return b->spec->textures;
}

/* Returns the file's name without folders and ending. This name is the object's where the file names no object. */
struct text_span build_base_name(const struct scene_build *b);

/* Limits of a reader in a process of its own: the file's, or the defaults. */
static inline struct scene_import_limits build_limits(const struct scene_build *b)
{
    return b->spec->limits != NULL ? *b->spec->limits : scene_import_defaults;
}

#endif
