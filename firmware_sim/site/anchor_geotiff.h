/* SPDX-License-Identifier: MIT */
/* Finds the scene's frame from its GeoTIFF meshes (scene.anchor.source geotiff). */
#ifndef FIRMWARE_SIM_SITE_ANCHOR_GEOTIFF_H
#define FIRMWARE_SIM_SITE_ANCHOR_GEOTIFF_H

#include "core/geoframe.h"

struct config;

/* A raster in UTM makes the scene a grid, exactly. Else the scene is tangent to the Earth at the raster's middle, and a
 * warning says how far its corners are from their place. SH_EINPUT: no such mesh, several systems, or none that PROJ
 * knows. */
int anchor_by_geotiff(const struct config *cfg, const struct sh_report *report, struct geoframe *frame,
                      struct sh_err *err);

#endif
