/* SPDX-License-Identifier: MIT */
/* Meshes packed by Draco (KHR_draco_mesh_compression): whether a file has some, so that Assimp has to read it, and what
 * Assimp leaves out of such a file. */
#ifndef CORE_IMPORT_GLTF_GLTF_DRACO_H
#define CORE_IMPORT_GLTF_GLTF_DRACO_H

#include <jansson.h>
#include <stdbool.h>

#include "core/err.h"

struct scene_build;

/* Whether some primitive can be read only by unpacking it. */
bool gltf_has_packed(const json_t *root);

/* Refuses a packed file that requires what Assimp doesn't read, and warns of what Assimp ignores. */
int gltf_check_for_assimp(struct scene_build *b, const json_t *root, struct sh_err *err);

#endif
