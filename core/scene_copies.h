/* Copies of meshes in a scene (core/scene.h), for those who need something else. */
#ifndef CORE_SCENE_COPIES_H
#define CORE_SCENE_COPIES_H

#include <math.h>

#include "core/scene.h"

/* Makes them triangles of the scene, which keep their numbers, labels, texture coordinates and holes. SH_EINPUT where
 * that were more than `most`. The scene is to be freed after an error. Before anyone uses it. */
int scene_write_out_copies(struct scene *scene, uint64_t most, const struct sh_report *report, struct sh_err *err);

#endif
