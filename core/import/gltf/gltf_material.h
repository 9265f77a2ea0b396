/* SPDX-License-Identifier: MIT */
/* A primitive's material gives it the label of its surface, and says where its texture coordinates come from. */
#ifndef CORE_IMPORT_GLTF_GLTF_MATERIAL_H
#define CORE_IMPORT_GLTF_GLTF_MATERIAL_H

#include <jansson.h>
#include <stdbool.h>
#include <stdint.h>

struct gltf;

/* A material as it lies on a primitive. */
struct gltf_look {
    uint16_t label;
    bool has_texture;
    uint32_t uv_set;
    double uv[2][3]; /* rows of the transform of texture coordinates */
    double cutoff;   /* a point of less opacity is a hole; 0: the material has no such holes, or none are wanted */
    double opacity;  /* of the whole surface: texture and vertices have a share of it */
};
/* Names all materials. Due once, before the first gltf_look_open. */
int gltf_name_materials(struct gltf *g);
/* Gives the label and the texture of a primitive. object: the name of its object. */
int gltf_look_open(struct gltf *g, const char *object, const json_t *primitive, const char *at, struct gltf_look *look);

#endif
