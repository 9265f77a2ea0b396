/* SPDX-License-Identifier: MIT */
/* Private to core/import. scene_load chooses from these readers. In: a builder whose spec names the file. Out: the
 * file's vertices and faces in the builder's scene. */
#ifndef CORE_IMPORT_READERS_H
#define CORE_IMPORT_READERS_H

#include "core/scene/build.h"

int read_obj(struct scene_build *b, struct sh_err *err);
/* A line `mtllib NAMES` of an OBJ. */
struct mtl_line {
    struct text_span names;
    uint64_t line;
};
/* Reads colours, opacities and textures of the surfaces from first_surface on. They come from the libraries that these
 * lines name; of each property the first definition counts. Meshes often come without a library, and have no colours
 * then. Warnings name missing libraries and, where textures are wanted, missing materials and textures. */
int read_mtl(struct scene_build *b, const struct mtl_line *line, size_t n, uint32_t first_surface, struct sh_err *err);
int read_ply(struct scene_build *b, struct sh_err *err);
int read_stl(struct scene_build *b, struct sh_err *err);
int import_apart(struct scene_build *b, struct sh_err *err); /* core/import/import_apart.c */
int read_ifc(struct scene_build *b, struct sh_err *err);     /* core/import/ifc/ */

#endif
