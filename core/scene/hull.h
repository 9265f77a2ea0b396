/* SPDX-License-Identifier: MIT */
/* Private to core/scene: the bounds of copies of a mesh. */
#ifndef CORE_SCENE_HULL_H
#define CORE_SCENE_HULL_H

#include "core/scene.h"

/* Sets the bounds of the mesh's n copies, whose places are set, and widens the scene's bounds by them. */
int scene_bound_copies(struct scene *scene, const struct scene *mesh, struct scene_copy *copy, size_t n,
                       const struct sh_report *report, struct sh_err *err);

#endif
