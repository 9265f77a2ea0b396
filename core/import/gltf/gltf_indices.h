/* SPDX-License-Identifier: MIT */
/* Warns of indices that name nothing, in all of the file. In what is drawn, such indices are errors. */
#ifndef CORE_IMPORT_GLTF_GLTF_INDICES_H
#define CORE_IMPORT_GLTF_GLTF_INDICES_H

#include <jansson.h>

struct scene_build;

void gltf_say_indices(const struct scene_build *b, const json_t *root);

#endif
