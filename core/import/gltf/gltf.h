/* SPDX-License-Identifier: MIT */
/* Private to core/import/gltf: reads a glTF 2.0 file into a scene. As with Assimp, all of it is read in a process of
 * its own, which has limits, and whose end frees all memory. Indices, counts and offsets come from the file:
 * none is used before it is checked. */
#ifndef CORE_IMPORT_GLTF_GLTF_H
#define CORE_IMPORT_GLTF_GLTF_H

#include <jansson.h>
#include <stdbool.h>
#include <stdint.h>

#include "core/import/gltf/gltf_bytes.h"
#include "core/scene/build.h"

/* Bytes of a buffer, view or accessor. These bytes are made at the first use, and kept for later ones. */
struct gltf_kept {
    struct gltf_bytes bytes;
    void *own; /* to be freed; NULL: they are part of something else */
    bool is_open;
};

struct gltf_node;

struct gltf {
    struct scene_build *b;
    struct sh_err *err;
    struct text file;
    json_t *root;
    struct gltf_bytes bin; /* of a .glb; p NULL: there is none */
    struct gltf_kept *buffer, *view, *accessor;
    uint32_t n_buffers, n_views, n_accessors, n_nodes, n_drawn;
    struct gltf_node *node;
    uint32_t *stack;       /* [n_nodes + 1] nodes still to come, while the tree is walked */
    json_t *names;         /* of materials, by number; no two are the same */
    bool by_assimp;        /* glTF 1.0, or meshes by Draco: Assimp reads it */
    double largest;        /* largest |coordinate| of positions in single precision */
    double error;          /* largest error of these, once they are placed */
    double step_error;     /* largest error of positions that are whole numbers, once they are placed */
    uint64_t n_done;       /* triangles, for the progress */
    uint32_t n_hidden;     /* nodes with meshes that KHR_node_visibility hides */
    uint32_t n_shapeless;  /* primitives without POSITION */
    uint32_t n_unmapped;   /* primitives without the texture coordinates that their material asks for */
    uint32_t n_jointless;  /* primitives with a skin, but without JOINTS_0: their node places them */
    uint64_t n_unweighted; /* vertices of a skin that no joint moves */
    uint64_t n_holes;      /* triangles without opacity, by a masked material or by COLOR_0 */
    uint64_t n_faded;      /* triangles of masked materials with opacities of COLOR_0 that are not read */
    uint32_t n_images;     /* primitives whose texture has a format that isn't read */
    char image[64];        /* the extension of the first of them */
    uint32_t n_odd;        /* values of materials that the format doesn't allow */
    char odd[48];          /* the first of them */
};

/* "FILE, mesh 'M': text": SH_EINPUT. */
#define gltf_fail(g, ...) build_fail((g)->b, SH_EINPUT, (g)->err, __VA_ARGS__)

#endif
