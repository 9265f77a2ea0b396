/* SPDX-License-Identifier: MIT */
/* Makes copies of meshes, and leaves some of their surfaces out. */
#ifndef CORE_SCENE_COPIES_H
#define CORE_SCENE_COPIES_H

#include "core/scene.h"

/* Adds the mesh, which the scene then owns, at all these places. After an error the mesh is still the caller's, but the
 * scene may have its textures. */
int scene_add_copies(struct scene *scene, struct scene *mesh, const struct scene_places *places,
                     const struct sh_report *report, struct sh_err *err);

/* Part of scene_keep: each copy keeps the surfaces that `keep` marks, by their labels. A copy without such a surface is
 * removed. label: new labels, by old ones. SH_EINPUT where copies of a mesh would keep different surfaces. */
int scene_keep_copies(struct scene *scene, const uint8_t *keep, const uint16_t *label, struct sh_err *err);

#endif
