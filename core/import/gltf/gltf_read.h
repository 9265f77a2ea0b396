/* SPDX-License-Identifier: MIT */
/* Reads glTF 2.0 into a scene, by its specification. README.md has the rules. */
#ifndef CORE_IMPORT_GLTF_GLTF_READ_H
#define CORE_IMPORT_GLTF_GLTF_READ_H

#include <stdbool.h>

#include "core/err.h"

struct scene_build;

/* Returns whether a file is glTF, by the ending of its name. */
bool gltf_is_name(const char *file);

/* Reads the file of b into b. The function is called in a process of its own (import_apart.c). SH_ESTATE: Assimp has to
 * read this file (glTF 1.0, Draco). */
int import_gltf(struct scene_build *b, struct sh_err *err);

#endif
