/* SPDX-License-Identifier: MIT */
/* A scene under survey, and bundles of rays in it. */
#include <math.h>
#include <string.h>

#include "core/studio/viewpoint/survey.h"
#include "core/vec3.h"

static void rays_set_up(struct survey *s, const struct scene *scene, const struct viewpoint_view *view)
{
    memset(s, 0, sizeof *s);
    s->scene = scene;
    s->view = view;
    for (int i = 0; i < 3; i++) {
        s->size_m[i] = scene->max_m[i] - scene->min_m[i];
        s->centre_m[i] = scene->min_m[i] + 0.5 * s->size_m[i];
    }
    s->radius_m = 0.5 * vec3_length(s->size_m);
}

int survey_open(struct survey *s, const struct scene *scene, const struct viewpoint_view *view,
                const struct sh_report *report, struct sh_err *err)
{
    rays_set_up(s, scene, view);
    int rc = bvh_create(scene, 0, report, &s->own, err);
    s->bvh = s->own;
    return rc == SH_OK ? bvh_work_create(&s->work, err) : rc;
}

int survey_borrow(struct survey *s, const struct bvh *bvh, const struct viewpoint_view *view, struct sh_err *err)
{
    rays_set_up(s, bvh_scene(bvh), view);
    s->bvh = bvh;
    return bvh_work_create(&s->work, err);
}

void survey_close(struct survey *s)
{
    bvh_work_free(s->work);
    bvh_free(s->own);
}

void survey_add(struct survey *s, const double from_m[3], const double dir[3])
{
    struct survey_rays *r = &s->rays;
    VEC3_SET(r->from, r->n, from_m);
    VEC3_SET(r->dir, r->n, dir);
    r->n++;
}

void survey_cast(struct survey *s)
{
    struct survey_rays *r = &s->rays;
    const struct bvh_rays rays = {.n = r->n,
                                  .from.own = {r->from.x, r->from.y, r->from.z},
                                  .dir = {r->dir.x, r->dir.y, r->dir.z},
                                  .range_max_m = 8.0 * s->radius_m + 4.0 * s->view->range_min_m,
                                  .scattered = 1,
                                  .range_m = r->range_m,
                                  .triangle = r->triangle};
    bvh_hits(s->work, s->bvh, &rays);
}

void survey_clear(struct survey *s)
{
    s->rays.n = 0;
}

int survey_descend(struct survey *s, struct survey_column *column, uint32_t n, const struct sh_report *report,
                   int (*take)(void *ctx, uint32_t i, double z_m), void *ctx)
{
    const double step_m = fmax(1e-6 * s->radius_m, 1e-6); /* coordinates up to 1e9 m still move by it */
    for (int open = 1; open && !sh_stopped(report);) {    /* a forest has hundreds of surfaces over its ground */
        open = 0;
        survey_clear(s);
        for (uint32_t i = 0; i < n; i++)
            survey_add(s, (const double[3]){column[i].x_m, column[i].y_m, column[i].top_m}, survey_down);
        survey_cast(s);
        for (uint32_t i = 0; i < n; i++) {
            if (isnan(s->rays.range_m[i])) continue;
            const double z_m = column[i].top_m - s->rays.range_m[i];
            open = 1;
            if (!take(ctx, i, z_m)) return 0;
            column[i].last_m = z_m;
            column[i].top_m = z_m - step_m;
        }
    }
    return 1;
}

double survey_cosine(const struct survey *s, uint32_t ray)
{
    const struct survey_rays *r = &s->rays;
    const double dir[3] = VEC3_AT(r->dir, ray);
    struct bvh_plane plane;
    bvh_get_plane(s->bvh, r->triangle[ray], &plane);
    return vec3_dot(plane.n, dir) / vec3_length(plane.n);
}

struct survey_sight survey_look(const struct survey *s, uint32_t first, uint32_t n)
{
    struct survey_sight sight = {0};
    uint32_t seen = 0, front = 0;
    double log_sum = 0.0;
    for (uint32_t i = first; i < first + n; i++) {
        double range_m = s->rays.range_m[i];
        if (!(range_m >= s->view->range_min_m && range_m <= s->view->range_max_m)) continue;
        seen++;
        front += survey_cosine(s, i) < 0.0;
        log_sum += log(range_m);
    }
    if (seen == 0) return sight;
    sight.seen = (double)seen / n;
    sight.front = (double)front / seen;
    sight.far_m = exp(log_sum / seen);
    return sight;
}

void survey_direction(double azimuth_rad, double elevation_rad, double dir[3])
{
    dir[0] = cos(elevation_rad) * sin(azimuth_rad);
    dir[1] = cos(elevation_rad) * cos(azimuth_rad);
    dir[2] = sin(elevation_rad);
}
