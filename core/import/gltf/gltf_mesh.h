/* SPDX-License-Identifier: MIT */
/* Adds the meshes of nodes to the builder, primitive by primitive. */
#ifndef CORE_IMPORT_GLTF_GLTF_MESH_H
#define CORE_IMPORT_GLTF_GLTF_MESH_H

#include <stdint.h>

#include "core/import/gltf/gltf_matrix.h"

struct gltf;

/* Adds the node's mesh, placed by the matrix `world`. object: the node's name. */
int gltf_add_mesh(struct gltf *g, uint32_t node, const char *object, const gltf_matrix world);

#endif
