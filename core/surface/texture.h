/* Private to core/surface: images that hold the reflectance. */
#ifndef CORE_SURFACE_TEXTURE_H
#define CORE_SURFACE_TEXTURE_H

#include "core/surface.h"

double surface_linear(double srgb);
void surface_textures_free(struct surface_table *table);

#endif
