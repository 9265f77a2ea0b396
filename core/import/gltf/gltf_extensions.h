/* SPDX-License-Identifier: MIT */
/* This says which extensions are known, what they mean for the file as a whole, and where an object has one. */
#ifndef CORE_IMPORT_GLTF_GLTF_EXTENSIONS_H
#define CORE_IMPORT_GLTF_GLTF_EXTENSIONS_H

#include <jansson.h>
#include <stdbool.h>

#include "core/err.h"

struct scene_build;

/* Refuses unknown extensions that the file requires, and warns of other unknown ones. root's extensionsRequired and
 * extensionsUsed are lists, or are not there. *by_assimp: whether Assimp has to read the file. */
int gltf_check_extensions(struct scene_build *b, const json_t *root, bool *by_assimp, struct sh_err *err);
bool gltf_is_required(const json_t *root, const char *extension);

/* NULL where the object has no such extension. */
json_t *gltf_extension(const json_t *of, const char *name);
/* Whether KHR_node_visibility hides a node, and the nodes below it. */
bool gltf_is_hidden(const json_t *node);
/* Whether a material has its colours by shaders, which are not read. */
bool gltf_is_by_shaders(const json_t *material);

#endif
