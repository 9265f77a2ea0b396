/* SPDX-License-Identifier: MIT */
/* The points of a mesh that is being recorded: arrays that grow together. In: points one by one. Out: arrays as
 * core/studio/mesh.h takes them. All points of a recording are held, with what belongs to them. */
#ifndef DRIVERS_RECORD_MESH_POINTS_H
#define DRIVERS_RECORD_MESH_POINTS_H

#include <stddef.h>
#include <stdint.h>

#include "core/err.h"

struct mesh_points {
    int has_frame; /* set by the owner: whether there are frame scalars */
    uint32_t n;
    double (*xyz_m)[3];
    float (*normal)[3];
    uint8_t (*rgb)[3];
    float (*uv)[2];
    double *range_m;
    float *reflectance_db;
    uint16_t *label, *station;
    double *frame; /* NULL where there is none */
    /* inner state */
    size_t room;
};

struct mesh_point {
    double xyz_m[3], range_m, frame;
    float normal[3], uv[2], reflectance_db;
    uint16_t label, station;
    uint8_t rgb[3];
};

/* Adds a point. SH_ENOMEM; SH_EINPUT: files of meshes hold no more points. The texts of both errors have the number of
 * points, and no path. */
int mesh_points_add(struct mesh_points *points, const struct mesh_point *point, struct sh_err *err);
void mesh_points_get(const struct mesh_points *points, uint32_t i, struct mesh_point *point);
/* Copies point `from` over point `to`. */
void mesh_points_move(struct mesh_points *points, uint32_t from, uint32_t to);
void mesh_points_free(struct mesh_points *points);

#endif
