/* SPDX-License-Identifier: MIT */
/* Polygons -> triangles by ear clipping, in double.
 *
 * The polygon is projected along the largest axis of its Newell normal, or, where that is nearly 0, of the normal of
 * its largest triangle. Points that lie on an edge keep their place (no triangle skips them, so neighbours still meet),
 * and holes may be joined by a keyhole edge.
 * The result is always n - 2 triangles. The triangles of a polygon that crosses itself overlap; `simple` is false
 * where this was noticed. Cost: n for convex polygons, n times the number of reflex corners otherwise. */
#ifndef CORE_SCENE_TRIANGULATE_H
#define CORE_SCENE_TRIANGULATE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "core/err.h"

/* Entry i of each list; together they are a cache line. */
struct triangulate_entry {
    double p[3];          /* in: corner i */
    uint32_t triangle[3]; /* out: triangle i, by numbers of corners, in the polygon's sense of rotation */
    uint32_t next, prev;  /* of corner i, among those that are left */
    uint32_t reflex;      /* the i-th corner that does not turn left */
    double uv[2];         /* corner i, projected */
};

/* One work space serves any number of polygons. Zero-initialise; release with triangulate_free. */
struct triangulate {
    struct triangulate_entry *at;
    size_t cap, n_reflex;
    bool simple;                    /* out */
    const struct sh_report *report; /* its stop is obeyed; NULL: nothing stops */
    bool stopped;                   /* out: there are no triangles */
};

/* Makes room for n corners. 0 or SH_ENOMEM; the old room stays valid then. */
int triangulate_reserve(struct triangulate *t, size_t n);

/* Cuts the n >= 3 corners in t->at into n - 2 triangles. */
void triangulate_polygon(struct triangulate *t, uint32_t n);

void triangulate_free(struct triangulate *t);

#endif
