/* SPDX-License-Identifier: MIT */
/* Finds the unit and the axes that a file's vertices have after Assimp has read it. Some formats define them; an FBX
 * file states them. */
#ifndef CORE_IMPORT_IMPORT_SAYS_H
#define CORE_IMPORT_IMPORT_SAYS_H

#include "core/scene.h"

struct aiScene;

struct scene_says import_says(const struct aiScene *in, const char *file);

#endif
