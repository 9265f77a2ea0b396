/* SPDX-License-Identifier: MIT */
/* Assimp reads FBX, Collada, glTF 1.0, and glTF 2.0 with Draco: we have no readers for these. Assimp also reads IFC
 * where the readers of IFC are not installed. */
#ifndef CORE_IMPORT_IMPORT_ASSIMP_H
#define CORE_IMPORT_IMPORT_ASSIMP_H

#include "core/err.h"

struct scene_build;

/* Fills b as a reader does. No other thread of the process may use Assimp meanwhile, since its logger is global. */
int import_assimp(struct scene_build *b, struct sh_err *err);

#endif
