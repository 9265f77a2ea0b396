/* SPDX-License-Identifier: MIT */
/* Points spread evenly over the mesh of a recording. In: the mesh's points and triangles, part by part. Out: points.
 * The points' figures are interpolated between the corners of their triangle; label and station are those of the corner
 * with the largest weight. */
#ifndef DRIVERS_RECORD_MESH_SPARSE_H
#define DRIVERS_RECORD_MESH_SPARSE_H

#include "drivers/record/mesh_points.h"

struct mesh_sparse {
    double per_m2;
    uint64_t seed;
    const struct sh_report *report;
};

/* A part of a mesh: triangles of one station and scan. */
struct mesh_sparse_part {
    const uint32_t (*face)[3];
    uint32_t n_faces, station, scan;
};

/* Takes one part: its triangles, station and scan. The places of points depend on the seed, the station and the scan
 * (core/studio/scan_mesh.h). Adds round(area * per_m2) points to `out`, black where points->rgb is NULL. *area_m2 grows
 * by the area. SH_EINPUT with the figures where there are more than a file or memory holds. */
int mesh_sparse_add(const struct mesh_sparse *sparse, const struct mesh_points *points,
                    const struct mesh_sparse_part *part, struct mesh_points *out, double *area_m2, struct sh_err *err);

#endif
