/* SPDX-License-Identifier: MIT */
/* This finds unit and axes of a file as Assimp gives it back: some formats define them, some files state them. */
#ifndef CORE_IMPORT_IMPORT_SAYS_H
#define CORE_IMPORT_IMPORT_SAYS_H

#include "core/scene.h"

struct aiScene;

struct scene_says import_says(const struct aiScene *in, const char *file);

#endif
