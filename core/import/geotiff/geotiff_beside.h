/* SPDX-License-Identifier: MIT */
/* Rasters of one scene that lie side by side. Vertices are at the middles of cells, so between the last column of one
 * raster and the first column of the next no triangle stands: a slit one cell wide, through which pulses pass. */
#ifndef CORE_IMPORT_GEOTIFF_GEOTIFF_BESIDE_H
#define CORE_IMPORT_GEOTIFF_GEOTIFF_BESIDE_H

#include "core/scene.h"

/* Warns of such slits between the files among specs, one line for all. Files that can't be read are passed over. */
void geotiff_warn_beside(const struct scene_mesh_spec *specs, size_t n_specs, const struct sh_report *report);

#endif
