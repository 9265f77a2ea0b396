/* SPDX-License-Identifier: MIT */
/* A viewpoint: a place from which a head sees much of a scene, for a first scan of an unknown mesh.
 *
 * In: a scene (prcs, metres, z up) and what a head reaches. Out: a position, a heading, and the part of the
 * field of view that is worth scanning. Three kinds are tried in this order, and the first that is good
 * enough is taken:
 *
 *   inside   above a level floor and below a ceiling, in a room whose surfaces face the head
 *   ground   above a level surface under the open sky: terrain, or between buildings
 *   outside at a distance from the whole scene, looking at it: an object, or a closed shell whose faces point
 *   outward
 *
 * How much a candidate sees is measured, by rays over the field of view. The same scene and view give the same
 * place. */
#ifndef CORE_STUDIO_VIEWPOINT_H
#define CORE_STUDIO_VIEWPOINT_H

#include "core/bvh.h"
#include "core/err.h"
#include "core/scene.h"

struct viewpoint_view {
    double range_min_m, range_max_m;
    double line_min_rad, line_max_rad; /* 0 level, pi/2 up; angles beyond the zenith don't count */
};

enum viewpoint_kind { VIEWPOINT_INSIDE, VIEWPOINT_GROUND, VIEWPOINT_OUTSIDE };

struct viewpoint {
    enum viewpoint_kind kind;
    double position_m[3]; /* of the head's origin */
    double floor_m;       /* height above the floor; NaN: outside */
    double seen;          /* share of the rays cast that hit something within the ranges */
    /* The part of the view to scan. Inside and on the ground: all of it, heading 0. Outside: the part that holds the
     * scene. */
    double heading_rad;          /* of pan 0, clockwise from y */
    double pan_rad;              /* from 0 to this */
    double line0_rad, line1_rad; /* within the view */
    int faces_out;               /* outside: there was a room, but its faces point outward */
};

/* SH_EINPUT: the view is empty, or holds nothing of the scene from any place that was tried. Takes memory and time for
 * a BVH. SH_ESTOPPED: report asks to stop. */
int viewpoint_find(const struct scene *scene, const struct viewpoint_view *view, const struct sh_report *report,
                   struct viewpoint *out, struct sh_err *err);

/* ---- places to choose from: a grid of them, on all floors. */

struct viewpoint_grid {
    double step_m;             /* of the grid along x and y; the grid is centred between min_m and max_m */
    double height_m;           /* of the head's origin above the floor */
    double min_m[3], max_m[3]; /* prcs; floors count whose z lies between these, to 0.5 mm; may be infinite along z */
};

struct viewpoint_place {
    double position_m[3]; /* of the head's origin, whole millimetres */
    double floor_m;       /* z of the floor */
};

enum { VIEWPOINT_MAX_PLACES = 1000000 };

/* Places where a tripod can stand: on a surface at most 20 degrees steep, with 0.2 m of room above the head. Around the
 * place, at a distance of 0.3 m, the surface is looked at in 8 directions. In at least 6 of these directions the
 * surface is on the place's level, to 0.15 m. At the height of the head nothing is nearer than 0.3 m in any of the 8
 * directions. Which side of the surface is up does not matter: some of the places may lie within closed bodies. In
 * order of x, then y, then z downward. The BVH is that of the whole scene. The caller frees *out. SH_EINPUT: more
 * columns than VIEWPOINT_MAX_PLACES. */
int viewpoint_places(const struct bvh *bvh, const struct viewpoint_grid *grid, const struct sh_report *report,
                     struct viewpoint_place **out, uint32_t *n, struct sh_err *err);

#endif
