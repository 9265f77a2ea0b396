/* SPDX-License-Identifier: MIT */
/* Nodes are a tree: this finds where each one is, and walks through those of the scene. */
#ifndef CORE_IMPORT_GLTF_GLTF_NODES_H
#define CORE_IMPORT_GLTF_GLTF_NODES_H

#include <jansson.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "core/import/gltf/gltf_matrix.h"

struct gltf;

struct gltf_node {
    gltf_matrix world;
    uint32_t parent;
    bool is_drawn, has_world;
};

/* Gives entry i of an object's list of nodes. at: the object, for messages. */
int gltf_node_number(struct gltf *g, const json_t *list, size_t i, const char *key, const char *at, uint32_t *out);
/* Finds where each node is. */
int gltf_place_nodes(struct gltf *g);
/* Adds the meshes of the scene's nodes, in their order. */
int gltf_draw_scene(struct gltf *g);

#endif
