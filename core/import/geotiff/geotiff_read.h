/* SPDX-License-Identifier: MIT */
/* Reads a GeoTIFF of heights into a scene: a vertex at the middle of each cell, two triangles between four of them. */
#ifndef CORE_IMPORT_GEOTIFF_GEOTIFF_READ_H
#define CORE_IMPORT_GEOTIFF_GEOTIFF_READ_H

#include "core/err.h"

struct scene_build;

/* Fills b as a reader does, in the process that reads: easting, northing and height, in metres, z up. */
int import_geotiff(struct scene_build *b, struct sh_err *err);

#endif
