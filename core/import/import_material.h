/* SPDX-License-Identifier: MIT */
/* Private to core/import: materials of Assimp -> colour and textures of a surface. */
#ifndef CORE_IMPORT_IMPORT_MATERIAL_H
#define CORE_IMPORT_IMPORT_MATERIAL_H

#include <stdbool.h>

#include "core/scene.h"

struct assimp_lib;
struct aiScene;
struct aiMaterial;
struct aiColor4D;
struct scene_build;

/* Takes the properties of a surface from its material. Properties that were set before are not changed. */
int import_material(const struct assimp_lib *lib, struct scene_build *b, const struct aiScene *in,
                    const struct aiMaterial *material, struct scene_surface *surface, struct sh_err *err);

/* Warns of materials whose colour is beyond 0 to 1: import_material doesn't take it. */
void import_say_colours(const struct assimp_lib *lib, const struct scene_build *b, const struct aiScene *in);

/* The colour of a vertex, as scene->rgb has it. */
void import_rgb(struct scene_build *b, const struct aiColor4D *colour, uint8_t rgb[4]);

/* How the material's textures lie on a mesh: coordinates of a set, times scale, plus shift. */
struct import_uv {
    unsigned set;
    double scale[2], shift[2];
    bool is_turned; /* the texture is rotated, too; not read, since its meaning in Assimp differs by format */
};
/* material: NULL for none. */
void import_uv(const struct assimp_lib *lib, const struct aiMaterial *material, struct import_uv *uv);

#endif
