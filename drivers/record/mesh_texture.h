/* SPDX-License-Identifier: MIT */
/* The image of a scan's grid as the texture of its mesh: a column a line and a row a shot, the scan's first row below.
 *
 * A point's texture coordinate is the middle of its texel, so that colours between points are those between texels. Where
 * the mesh closes behind its last line or row, and at poles, points are doubled: a point has one texture coordinate, and
 * needs two there. Images have up to MESH_TEXTURE_SIDE texels a side; of a larger grid each n-th line and row is taken. */
#ifndef DRIVERS_RECORD_MESH_TEXTURE_H
#define DRIVERS_RECORD_MESH_TEXTURE_H

#include "core/studio/picture.h"
#include "core/studio/scan_mesh.h"
#include "drivers/record/mesh_grid.h"
#include "drivers/record/mesh_points.h"

enum { MESH_TEXTURE_SIDE = 16384 };

/* Sets the texture coordinates of the grid's points, and draws their colours; places without an echo are black.
 * picture_free is due in any case. *every: 1, or which lines and rows the image has. SH_ENOMEM. */
int mesh_texture_draw(const struct mesh_grid *grid, struct mesh_points *points, struct picture *image, uint32_t *every,
                      struct sh_err *err);

/* Doubles points, at the end of `points`, where faces cross the seam; they get texture coordinates beyond 1, where the image
 * is repeated. faces: of all points of the recording; those from first_face on are of this grid, whose points are all
 * there are from grid->first on, in their order. */
int mesh_texture_unwrap(const struct mesh_grid *grid, struct mesh_points *points, uint32_t (*face)[3], uint32_t n_faces,
                        struct sh_err *err);

#endif
