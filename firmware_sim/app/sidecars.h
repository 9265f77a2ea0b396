/* SPDX-License-Identifier: MIT */
/* The files that a mesh file names: materials (.mtl), buffers (.bin), images. In: the mesh's path. Out: each one that
 * is there, in the order in which they are named.
 *
 * The search doesn't parse the formats. A name is any text that ends in .mtl, .bin, .png, .jpg, .jpeg, .tga, .bmp or
 * .webp and leads to a file, as it stands or by its last part. The named file is looked for in the folder of the file
 * that names it, and in the mesh's. So the search may find more files than a reader opens. The search misses names of
 * more than 255 bytes, and escapes other than %XX. */
#ifndef FIRMWARE_SIM_APP_SIDECARS_H
#define FIRMWARE_SIM_APP_SIDECARS_H

#include "core/err.h"

/* `take` gets the name as it stands, and the path. A result other than SH_OK ends the search, and is returned. A .stl
 * names no files. */
int app_sidecars(const char *mesh, int (*take)(void *ctx, const char *name, const char *path), void *ctx,
                 struct sh_err *err);

#endif
