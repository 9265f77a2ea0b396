/* SPDX-License-Identifier: MIT */
/* Private to mesh.c and mesh_write.c: a mesh that is being recorded. mesh.c makes it, mesh_write.c writes it. */
#ifndef DRIVERS_RECORD_MESH_RECORDER_H
#define DRIVERS_RECORD_MESH_RECORDER_H

#include <string.h>

#include "core/studio/mesh.h"
#include "core/studio/picture.h"
#include "drivers/record/mesh_grid.h"
#include "drivers/record/mesh_points.h"
#include "drivers/record/recorder.h"

/* One grid's mesh. */
struct part {
    uint32_t n_points, n_faces, station, scan, sweep;
    char name[64], profile[32], texture[MESH_NAME_LEN];
    struct picture image;
};

struct mesh_recorder {
    struct recorder base;
    struct mesh_points points; /* those of the present grid last */
    struct mesh_grid grid;
    uint32_t (*face)[3];
    size_t n_faces, room_faces;
    struct part *part;
    size_t n_parts, room_parts;
    int begun, several; /* several: scanners, which have profiles of their own */
    char idn[96], profile[32];
    /* figures for the report */
    uint64_t n_later, n_loose, n_long, n_flat, n_lost, n_split;
    uint64_t n_edges;
    double edges_m, area_m2; /* sum of lengths */
    uint32_t every;          /* the largest `every` of all images (mesh_texture_draw) */
};

static inline int is_ply(const struct mesh_recorder *m)
{
    return strcmp(m->base.ops->ending, ".ply") == 0;
}

/* A format with materials has its colours in an image, except with --colour none. */
static inline int is_textured(const struct mesh_recorder *m)
{
    const struct colour_choice *c = &m->base.options.colour;
    return !is_ply(m) && !(c->given && c->scale.mode == COLOUR_NONE);
}

/* Puts the path before the text of an error, if rc is one. Returns rc. */
static inline int name_path(const struct mesh_recorder *m, int rc, struct sh_err *err)
{
    if (rc == SH_OK || err == NULL) return rc;
    const struct sh_err why = *err;
    return sh_fail(err, rc, "%s: %s", m->base.track.path, why.text);
}

/* Writes the mesh with its textures, or the points spread over it, under the recording's path. */
int mesh_recorder_write(struct mesh_recorder *recorder, struct sh_err *err);

#endif
