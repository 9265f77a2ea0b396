/* SPDX-License-Identifier: MIT */
/* glTF 2.0 into a scene, by its specification. README.md has the rules. */
#ifndef CORE_IMPORT_GLTF_GLTF_READ_H
#define CORE_IMPORT_GLTF_GLTF_READ_H

#include <stdbool.h>

#include "core/err.h"

struct scene_build;

/* Whether the file is one, by its ending. */
bool gltf_is_name(const char *file);

/* Fills b as a reader does, in the process that reads. SH_ESTATE: the file is for Assimp (glTF 1.0, Draco). */
int import_gltf(struct scene_build *b, struct sh_err *err);

#endif
