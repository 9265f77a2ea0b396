/* SPDX-License-Identifier: MIT */
/* Private to this folder: the scene that is looked at, and bundles of rays in it. */
#ifndef CORE_STUDIO_VIEWPOINT_SURVEY_H
#define CORE_STUDIO_VIEWPOINT_SURVEY_H

#include "core/bvh.h"
#include "core/studio/viewpoint.h"

struct survey_rays {
    uint32_t n;
    struct {
        double x[BVH_CHUNK], y[BVH_CHUNK], z[BVH_CHUNK];
    } from, dir;
    /* out: */
    double range_m[BVH_CHUNK]; /* NaN: nothing */
    uint32_t triangle[BVH_CHUNK];
};

struct survey {
    const struct scene *scene;
    const struct viewpoint_view *view;
    double centre_m[3], size_m[3], radius_m; /* of the bounds, and of the sphere around them */
    int is_part;                             /* the bounds are those of a part of the scene */
    const struct bvh *bvh;
    struct bvh *own; /* NULL: borrowed */
    struct bvh_work *work;
    struct survey_rays rays;
};

/* survey_close is due in any case. */
int survey_open(struct survey *s, const struct scene *scene, const struct viewpoint_view *view,
                const struct sh_report *report, struct sh_err *err);
/* The same with the caller's BVH. */
int survey_borrow(struct survey *s, const struct bvh *bvh, const struct viewpoint_view *view, struct sh_err *err);
void survey_close(struct survey *s);

/* Adds a ray; there is room for BVH_CHUNK. */
void survey_add(struct survey *s, const double from_m[3], const double dir[3]);
/* Casts the rays that were added. The next survey_add after survey_clear begins anew. */
void survey_cast(struct survey *s);
void survey_clear(struct survey *s);

/* A column of the scene that rays go down, from surface to surface. */
struct survey_column {
    double x_m, y_m;
    double top_m;  /* where the next ray begins, just below the last surface */
    double last_m; /* that surface; INFINITY: none yet */
};
static const double survey_down[3] = {0.0, 0.0, -1.0};
/* Follows n <= BVH_CHUNK columns together, until none has a further surface or report asks to stop. take gets each
 * surface at z_m, hit by ray i of column i, whose last_m is still the surface above. Returns 0 where take does. */
int survey_descend(struct survey *s, struct survey_column *column, uint32_t n, const struct sh_report *report,
                   int (*take)(void *ctx, uint32_t i, double z_m), void *ctx);

/* Returns the cosine between a ray and its triangle's normal, -1..1: negative where it hits the front. */
double survey_cosine(const struct survey *s, uint32_t ray);

/* survey_look returns these figures of the rays first to first + n - 1. */
struct survey_sight {
    double seen;  /* share of the rays that hit something in range */
    double front; /* share of these hits that are on the front of a triangle */
    double far_m; /* geometric mean of the ranges of these hits; 0: there is no hit */
};
struct survey_sight survey_look(const struct survey *s, uint32_t first, uint32_t n);

/* Sets dir to the direction at an azimuth (clockwise from y) and an elevation. */
void survey_direction(double azimuth_rad, double elevation_rad, double dir[3]);

/* floors.c: the best place above a floor, inside and on the ground. The score is 0 where there is none. */
struct survey_best {
    double inside_score, ground_score;
    struct viewpoint inside, ground;
    int faces_out; /* a place inside was left out, since it sees backs of faces */
};
int survey_floors(struct survey *s, const struct sh_report *report, struct survey_best *best, struct sh_err *err);

/* outside.c: finds the best place outside. Returns 0 where the view holds none of the scene from any place. */
int survey_outside(struct survey *s, struct viewpoint *out);
/* Sets the bounds to those of the part that has the most surface. A part is a cell, a quarter of the range wide. Cells
 * are wider where a side of the scene would have more than 64 of them. */
int survey_narrow(struct survey *s, struct sh_err *err);

#endif
