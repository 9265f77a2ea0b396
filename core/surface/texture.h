/* SPDX-License-Identifier: MIT */
/* Private to core/surface: images that hold the reflectance. In: sRGB values 0 to 1, a table with textures.
 * Out: linear values; the textures freed. */
#ifndef CORE_SURFACE_TEXTURE_H
#define CORE_SURFACE_TEXTURE_H

#include "core/surface.h"

double surface_luminance(const float rgb[3]);
void surface_textures_free(struct surface_table *table);

#endif
