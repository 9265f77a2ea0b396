/* SPDX-License-Identifier: MIT */
/* Private to core/surface. surface_luminance: sRGB values, 0 to 1, -> linear luminance. surface_textures_free: frees a
 * table's images and flags of vertex colours. */
#ifndef CORE_SURFACE_TEXTURE_H
#define CORE_SURFACE_TEXTURE_H

#include "core/surface.h"

double surface_luminance(const float rgb[3]);
void surface_textures_free(struct surface_table *table);

#endif
