/* SPDX-License-Identifier: MIT */
/* Textures cut holes into surfaces: these functions find them as a scene is made. */
#ifndef CORE_SCENE_CUTOUTS_H
#define CORE_SCENE_CUTOUTS_H

#include "core/scene.h"

/* Finds holes in the textures of a complete scene. Warns of textures that would cut holes but can't be read. */
int scene_find_cutouts(struct scene *scene, const struct sh_report *report, struct sh_err *err);
/* Drops all textures. Texture coordinates stay where a surface has holes, whose masks the scene then holds. */
void scene_drop_textures(struct scene *scene);

#endif
