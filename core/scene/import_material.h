/* Private to core/scene/import_*.c: materials of Assimp -> colour and textures of a surface. */
#ifndef CORE_SCENE_IMPORT_MATERIAL_H
#define CORE_SCENE_IMPORT_MATERIAL_H

#include "core/scene/build.h"

struct aiScene;
struct aiMaterial;

/* What the material says of a surface; what is there already stays. */
int import_material(struct scene_build *b, const struct aiScene *in, const struct aiMaterial *material,
                    struct scene_surface *surface, struct sh_err *err);

/* Which of a mesh's sets of texture coordinates the material's textures use. */
unsigned import_uv_set(const struct aiMaterial *material);

#endif
