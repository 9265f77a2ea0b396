/* SPDX-License-Identifier: MIT */
#include "drivers/record/mesh_points.h"

#include <stdlib.h>
#include <string.h>

#include "core/grow.h"
#include "core/studio/mesh.h"

static int grow_all(struct mesh_points *p, struct sh_err *err)
{
    const size_t n = p->room + p->room / 2 + 4096;
    if (resize(&p->xyz_m, n, sizeof *p->xyz_m) && resize(&p->normal, n, sizeof *p->normal) &&
        resize(&p->rgb, n, sizeof *p->rgb) && resize(&p->uv, n, sizeof *p->uv) &&
        resize(&p->range_m, n, sizeof *p->range_m) && resize(&p->reflectance_db, n, sizeof *p->reflectance_db) &&
        resize(&p->label, n, sizeof *p->label) && resize(&p->station, n, sizeof *p->station) &&
        (!p->has_frame || resize(&p->frame, n, sizeof *p->frame))) {
        p->room = n;
        return SH_OK;
    }
    return sh_fail(err, SH_ENOMEM, "no memory for more than %u points; a mesh keeps all its points in memory", p->n);
}

static void mesh_points_put(struct mesh_points *p, uint32_t i, const struct mesh_point *point)
{
    memcpy(p->xyz_m[i], point->xyz_m, sizeof point->xyz_m);
    memcpy(p->normal[i], point->normal, sizeof point->normal);
    memcpy(p->rgb[i], point->rgb, sizeof point->rgb);
    memcpy(p->uv[i], point->uv, sizeof point->uv);
    p->range_m[i] = point->range_m;
    p->reflectance_db[i] = point->reflectance_db;
    p->label[i] = point->label;
    p->station[i] = point->station;
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
    memcpy(point->xyz_m, p->xyz_m[i], sizeof point->xyz_m);
    memcpy(point->normal, p->normal[i], sizeof point->normal);
    memcpy(point->rgb, p->rgb[i], sizeof point->rgb);
    memcpy(point->uv, p->uv[i], sizeof point->uv);
    point->range_m = p->range_m[i];
    point->reflectance_db = p->reflectance_db[i];
    point->label = p->label[i];
    point->station = p->station[i];
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
    void *all[] = {p->xyz_m, p->normal, p->rgb, p->uv, p->range_m, p->reflectance_db, p->label, p->station, p->frame};
    for (size_t i = 0; i < sizeof all / sizeof all[0]; i++)
        free(all[i]);
    memset(p, 0, sizeof *p);
}
