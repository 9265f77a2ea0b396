/* SPDX-License-Identifier: MIT */
/* Private to core/scene: the outline of a mesh seen from above, and the bounds of its copies. */
#ifndef CORE_SCENE_HULL_H
#define CORE_SCENE_HULL_H

#include "core/scene.h"

struct scene_hull {
    double (*point)[2]; /* the convex hull of the used vertices */
    uint32_t n;
};

int scene_find_hull(const struct scene *scene, struct scene_hull *out, struct sh_err *err);
void scene_free_hull(struct scene_hull *hull);
void scene_set_copy_bounds(const struct scene *mesh, const struct scene_hull *hull, struct scene_copy *copy);
/* Widens the scene's bounds by these copies. */
void scene_widen(struct scene *scene, const struct scene_copy *copy, size_t n);

#endif
