/* SPDX-License-Identifier: MIT */
/* Private to core/import/gltf: reads a glTF 2.0 file into a scene. As with Assimp, all of it is read in a process of
 * its own: that has the limits, and its end frees memory after a crash. Indices, counts and offsets come from the file:
 * none is used before it is checked. */
#ifndef CORE_IMPORT_GLTF_GLTF_H
#define CORE_IMPORT_GLTF_GLTF_H

#include <jansson.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "core/scene/build.h"

#define GLTF_NONE UINT32_MAX /* an index that the file doesn't give */

/* Rows of an affine matrix: x' = row . (x, 1). */
typedef double gltf_matrix[3][4];

struct gltf_bytes {
    const uint8_t *p;
    size_t n;
};

/* Bytes that are kept once, however often they are asked for. */
struct gltf_kept {
    struct gltf_bytes bytes;
    void *own; /* to be freed; NULL: they are part of something else */
    bool is_open;
};

struct gltf_node {
    gltf_matrix world;
    uint32_t parent;
    bool is_drawn, has_world;
};

struct gltf {
    struct scene_build *b;
    struct sh_err *err;
    struct text file;
    json_t *root;
    struct gltf_bytes bin; /* of a .glb; p NULL: there is none */
    struct gltf_kept *buffer, *view, *accessor;
    uint32_t n_buffers, n_views, n_accessors, n_nodes, n_drawn;
    struct gltf_node *node;
    json_t *names;         /* of materials: by number, no two the same */
    bool by_assimp;        /* glTF 1.0, or meshes by Draco: Assimp reads it */
    double largest;        /* |coordinate|, of positions in single precision */
    double error;          /* of these, once they are placed */
    double step_error;     /* of positions that are whole numbers, once they are placed */
    uint64_t n_done;       /* triangles, for the progress */
    uint32_t n_hidden;     /* nodes with meshes that KHR_node_visibility hides */
    uint32_t n_shapeless;  /* primitives without POSITION */
    uint32_t n_unmapped;   /* primitives without the texture coordinates that their material asks for */
    uint32_t n_jointless;  /* primitives with a skin, but without JOINTS_0: their node places them */
    uint64_t n_unweighted; /* vertices of a skin that no joint moves */
    uint32_t n_images;     /* textures of a format that isn't read */
    char image[64];        /* the extension of the first of them */
    uint32_t n_odd;        /* values of materials that the format doesn't allow */
    char odd[48];          /* the first of them */
};

/* "FILE, mesh 'M': text": SH_EINPUT. */
#define gltf_fail(g, ...) build_fail((g)->b, SH_EINPUT, (g)->err, __VA_ARGS__)

/* ---- gltf_json.c: values of JSON. `of` may be NULL; at: where it is in the file, for messages. */

struct gltf_at {
    char text[96];
};
struct gltf_at gltf_at(const char *fmt, ...) __attribute__((format(printf, 1, 2)));

/* The object number i of a list on the top level. */
int gltf_object(struct gltf *g, const char *list, uint32_t i, json_t **out);
/* An index; GLTF_NONE where it isn't there. */
int gltf_index(struct gltf *g, const json_t *of, const char *key, const char *at, uint32_t *out);
/* A whole number up to 2^53; *out stays where it isn't there. */
int gltf_whole(struct gltf *g, const json_t *of, const char *key, const char *at, uint64_t *out);
/* n numbers; *out stays where they are not there. *found may be NULL. */
int gltf_numbers(struct gltf *g, const json_t *of, const char *key, const char *at, size_t n, double *out, bool *found);
/* A list; NULL where it isn't there. */
int gltf_list(struct gltf *g, const json_t *of, const char *key, const char *at, json_t **out);
/* An object; NULL where it isn't there. */
int gltf_child(struct gltf *g, const json_t *of, const char *key, const char *at, json_t **out);
/* NULL where there is no such extension. */
json_t *gltf_extension(const json_t *of, const char *name);
const char *gltf_text(const json_t *of, const char *key);

/* ---- gltf_file.c */

/* Reads the file: JSON, and the binary part of a .glb. */
int gltf_open(struct gltf *g);
void gltf_close(struct gltf *g);
int gltf_buffer(struct gltf *g, uint32_t buffer, struct gltf_bytes *out);

/* ---- gltf_uri.c */

/* Whether the URI contains its data. */
bool gltf_uri_is_data(const char *uri);
/* Decodes a URI that contains its data; *own is to be freed. */
int gltf_uri_data(struct gltf *g, const char *uri, const char *at, void **own, struct gltf_bytes *out);
/* The file name that a URI stands for, with %20 and the like decoded; to be freed. NULL: no memory. */
char *gltf_uri_name(const char *uri);

/* ---- gltf_extensions.c: refuses unknown extensions that are required; warns of other unknown ones. */
int gltf_check_extensions(struct gltf *g);
/* Whether a material has its colours by shaders, which are not read. */
bool gltf_is_by_shaders(const json_t *material);
bool gltf_is_required(const struct gltf *g, const char *extension);

/* ---- gltf_indices.c: warns of indices that name nothing, in all of the file. In what is drawn, such indices are
 * errors. */
void gltf_say_indices(const struct gltf *g);

/* ---- gltf_meshopt.c: decodes a buffer view, `more` is its extension. */
int gltf_meshopt(struct gltf *g, const json_t *more, const char *at, struct gltf_kept *out);

/* ---- gltf_accessor.c */

enum gltf_component {
    GLTF_I8 = 5120,
    GLTF_U8 = 5121,
    GLTF_I16 = 5122,
    GLTF_U16 = 5123,
    GLTF_U32 = 5125,
    GLTF_F32 = 5126,
};

/* An accessor that is checked: elements 0 to count - 1 may be asked for. */
struct gltf_view {
    const uint8_t *data; /* NULL: all are zero */
    uint64_t stride;
    uint32_t count, n_components;
    enum gltf_component component;
    bool is_normalized;
};
/* The bytes of a buffer view; stride 0: elements without gaps. */
int gltf_buffer_view(struct gltf *g, uint32_t view, struct gltf_bytes *out, uint64_t *stride);
/* type: "VEC3". accessor GLTF_NONE is an error. */
int gltf_view_open(struct gltf *g, uint32_t accessor, const char *type, struct gltf_view *out);
/* Component k of element i; normalized ones are -1 to 1. */
double gltf_value(const struct gltf_view *v, uint32_t i, uint32_t k);
/* Whole numbers have an error of up to half of this. 0: they are floats. */
double gltf_step(const struct gltf_view *v);

/* ---- gltf_nodes.c */

void gltf_multiply(const gltf_matrix a, const gltf_matrix b, gltf_matrix out);
void gltf_apply(const gltf_matrix m, const double v[3], double out[3]);
/* Translation, rotation (x, y, z, w) and scale as a matrix. False: r is no rotation. */
bool gltf_compose(const double t[3], const double r[4], const double s[3], gltf_matrix out);
/* Finds where each node is. */
int gltf_place_nodes(struct gltf *g);
/* Adds the meshes of the scene's nodes, in their order. */
int gltf_draw_scene(struct gltf *g);

/* ---- gltf_pose.c: where a mesh's vertices are once morph targets and joints have moved them. */

enum { GLTF_MAX_SETS = 8 };

struct gltf_target {
    struct gltf_view position;
    double weight;
};

struct gltf_pose {
    struct gltf_view position;
    struct gltf_target *target; /* those with an effect */
    size_t n_targets;
    gltf_matrix *joint, *reach; /* [n_joints] NULL: no skin. reach: joint's sums, of absolute values */
    uint32_t n_joints;
    struct gltf_view joints[GLTF_MAX_SETS], weights[GLTF_MAX_SETS];
    uint32_t n_sets;
    double most[3];   /* |coordinate| of the terms of a position before joints move it */
    double most_bent; /* |coordinate| of the terms where joints move it */
};
int gltf_pose_open(struct gltf *g, const json_t *node, const json_t *mesh, const json_t *primitive, const char *at,
                   struct gltf_pose *pose);
/* Vertex i < position.count, in the frame of the node, or of the scene where there is a skin. */
int gltf_pose_vertex(struct gltf *g, struct gltf_pose *pose, uint32_t i, double out[3]);
/* Adds the rounding error of vertices, once `world` has placed them. */
void gltf_pose_error(struct gltf *g, const struct gltf_pose *pose, const gltf_matrix world);
void gltf_pose_close(struct gltf_pose *pose);

/* ---- gltf_material.c */

/* A material as it lies on a primitive. */
struct gltf_look {
    uint16_t label;
    bool has_texture;
    uint32_t uv_set;
    double uv[2][3]; /* rows of the transform of texture coordinates */
};
int gltf_name_materials(struct gltf *g);
/* object: its name. */
int gltf_look_open(struct gltf *g, const char *object, const json_t *primitive, const char *at, struct gltf_look *look);

/* ---- gltf_mesh.c: the node's mesh, at `world`. */
int gltf_add_mesh(struct gltf *g, uint32_t node, const char *object, const gltf_matrix world);

#endif
