/* SPDX-License-Identifier: MIT */
/* Private to core/cast: this finds the place on a texture, or between vertices, where rays have hit a mesh. */
#ifndef CORE_CAST_TEXELS_H
#define CORE_CAST_TEXELS_H

#include "core/cast.h"

struct ray_hits;

/* Looks up reflectance and colour at each hit. The reflectance goes into the high bits of the hit's label, as
 * surface_texel defines them, and the colour into hits->colour. Does nothing where surfaces have neither
 * textures nor colours of vertices, and no colours are asked for. */
void caster_texels(const struct cast_setup *s, const struct ray_hits *hits);

#endif
