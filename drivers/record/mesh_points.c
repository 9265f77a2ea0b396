/* SPDX-License-Identifier: MIT */
#include "drivers/record/mesh_points.h"

#include <stdlib.h>
#include <string.h>

#include "core/grow.h"
#include "core/studio/mesh.h"

/* Does something with each array, but for `frame`, which not all recordings have. */
#define ARRAYS(DO)  DO(xyz_m) DO(normal) DO(rgb) DO(uv) DO(range_m) DO(reflectance_db) DO(label) DO(station)
#define GROW(array) has_grown = has_grown && resize(&p->array, n, sizeof *p->array);
#define PUT(array)  memcpy(&p->array[i], &point->array, sizeof point->array);
#define GET(array)  memcpy(&point->array, &p->array[i], sizeof point->array);
#define FREE(array) free(p->array);

static int grow_all(struct mesh_points *p, struct sh_err *err)
{
    const size_t n = p->room + p->room / 2 + 4096;
    int has_grown = !p->has_frame || resize(&p->frame, n, sizeof *p->frame);
    ARRAYS(GROW)
    if (!has_grown)
        return sh_fail(err, SH_ENOMEM, "no memory for more than %u points; a mesh keeps all its points in memory",
                       p->n);
    p->room = n;
    return SH_OK;
}

static void mesh_points_put(struct mesh_points *p, uint32_t i, const struct mesh_point *point)
{
    ARRAYS(PUT)
    if (p->has_frame) p->frame[i] = point->frame;
}

int mesh_points_add(struct mesh_points *p, const struct mesh_point *point, struct sh_err *err)
{
    if (p->n == MESH_MAX_VERTICES)
        return sh_fail(err, SH_EINPUT, "more than %d points; a mesh holds no more: scan fewer stations, or --split",
                       MESH_MAX_VERTICES);
    if (p->n == p->room && grow_all(p, err) != SH_OK) return SH_ENOMEM;
    mesh_points_put(p, p->n++, point);
    return SH_OK;
}

void mesh_points_get(const struct mesh_points *p, uint32_t i, struct mesh_point *point)
{
    ARRAYS(GET)
    point->frame = p->has_frame ? p->frame[i] : 0;
}

void mesh_points_move(struct mesh_points *p, uint32_t from, uint32_t to)
{
    struct mesh_point point;
    if (from == to) return;
    mesh_points_get(p, from, &point);
    mesh_points_put(p, to, &point);
}

void mesh_points_free(struct mesh_points *p)
{
    ARRAYS(FREE)
    free(p->frame);
    memset(p, 0, sizeof *p);
}
