/* SPDX-License-Identifier: MIT */
/* Unit and axes of an imported file, as it comes out of Assimp: some formats define them, some files say
 * them. */
#ifndef CORE_IMPORT_IMPORT_SAYS_H
#define CORE_IMPORT_IMPORT_SAYS_H

#include "core/scene.h"

struct aiScene;

struct scene_says import_says(const struct aiScene *in, const char *file);

#endif
