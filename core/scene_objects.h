/* SPDX-License-Identifier: MIT */
/* The objects of a scene, and figures of each: triangles, open edges, area, volume. An object is all surfaces of one
 * name, with their copies. In: a scene. Out: a row for each object, in the order of their first labels. Not real-time
 * safe. */
#ifndef CORE_SCENE_OBJECTS_H
#define CORE_SCENE_OBJECTS_H

#include "core/scene.h"

enum scene_object_state {
    SCENE_OBJECT_EMPTY,  /* no triangle is left of it */
    SCENE_OBJECT_CLOSED, /* each edge has its counterpart, or edges without one cancel (core/body.h) */
    SCENE_OBJECT_TURNED, /* there are no open edges, but neighbouring faces look to different sides */
    SCENE_OBJECT_OPEN,
};

struct scene_object {
    uint32_t surface; /* its first */
    uint32_t n_surfaces;
    uint64_t n_triangles; /* with those of copies */
    uint64_t n_open;      /* edges that an odd number of triangles share; 0 where it is closed */
    double area_m2;
    double volume_m3; /* above 0 where its faces look outward; NaN: it is open or turned; 0: it is empty */
    enum scene_object_state state;
};

struct scene_objects {
    struct scene_object *object; /* [n] */
    uint32_t n;
    uint32_t *of; /* [n_surfaces] the object of each surface */
};

/* Receives each open edge that n_open counts, with its ends a and b in either order, prcs. */
struct scene_open_edges {
    void *ctx;
    int (*take)(void *ctx, const double a[3], const double b[3], struct sh_err *err);
};

/* Corners at the same place, bit for bit, are one. The search takes up to 150 bytes a triangle of the largest object
 * while it works. edges NULL: they are only counted. Fails with SH_ENOMEM, SH_ESTOPPED, or the error of edges->take.
 * scene_objects_free is due in any case. */
int scene_objects_find(const struct scene *scene, const struct scene_open_edges *edges, const struct sh_report *report,
                       struct scene_objects *objects, struct sh_err *err);
void scene_objects_free(struct scene_objects *objects);

#endif
