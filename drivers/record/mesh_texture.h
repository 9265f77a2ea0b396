/* SPDX-License-Identifier: MIT */
/* The image of a scan's grid as the texture of its mesh: one column per line, one row per shot, the first row at the
 * bottom.
 *
 * A point's texture coordinate is the middle of its texel, so that colours between points are those between texels.
 * Where the mesh closes after its last line or row, and at poles, a point needs two texture coordinates, so it is
 * doubled. Images have up to MESH_TEXTURE_SIDE texels a side; a larger grid has only each n-th line and row in the
 * image. */
#ifndef DRIVERS_RECORD_MESH_TEXTURE_H
#define DRIVERS_RECORD_MESH_TEXTURE_H

#include "core/studio/picture.h"
#include "core/studio/scan_mesh.h"
#include "drivers/record/mesh_grid.h"
#include "drivers/record/mesh_points.h"

enum { MESH_TEXTURE_SIDE = 16384 };

/* Sets the texture coordinates of the grid's points, and draws their colours; places without an echo are black.
 * The caller calls picture_free in any case. The image has only each *every-th line and row. SH_ENOMEM. */
int mesh_texture_draw(const struct mesh_grid *grid, struct mesh_points *points, struct picture *image, uint32_t *every,
                      struct sh_err *err);

/* Doubles points where faces cross the seam. The new points stand at the end of `points` and have texture coordinates
 * beyond 1, where the image is repeated. All of these faces belong to this grid; its points are all points from
 * grid->first on, in their order. */
int mesh_texture_unwrap(const struct mesh_grid *grid, struct mesh_points *points, uint32_t (*face)[3], uint32_t n_faces,
                        struct sh_err *err);

#endif
