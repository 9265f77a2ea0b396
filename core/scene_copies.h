/* SPDX-License-Identifier: MIT */
/* Copies of meshes in a scene (core/scene.h), for code that needs plain triangles. */
#ifndef CORE_SCENE_COPIES_H
#define CORE_SCENE_COPIES_H

#include "core/scene.h"

/* Turns copies into triangles of the scene. The triangles keep their numbers, labels, texture coordinates and holes. To
 * be called before anyone uses the scene. SH_EINPUT where there would be more than `most`. After an error the scene is
 * to be freed. */
int scene_write_out_copies(struct scene *scene, uint64_t most, const struct sh_report *report, struct sh_err *err);

#endif
