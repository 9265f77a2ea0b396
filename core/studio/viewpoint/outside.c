/* SPDX-License-Identifier: MIT */
/* Places around the scene, from which it is looked at. */
#include <math.h>
#include <stdlib.h>

#include "core/angle.h"
#include "core/studio/viewpoint/survey.h"
#include "core/vec3.h"

enum { SIDES = 8, HEIGHTS = 3, GRID = 24 };

/* Front, half front, sides, backs: azimuths at which the station looks, and what each is worth. */
static const double side_deg[SIDES] = {0, 45, -45, 90, -90, 135, -135, 180};
static const double side_worth[SIDES] = {1.0, 0.95, 0.95, 0.9, 0.9, 0.85, 0.85, 0.8};
static const double height_deg[HEIGHTS] = {8, 22, 35}, height_worth[HEIGHTS] = {1.0, 0.9, 0.8};

/* Returns the distance from the centre. From there the sphere around the scene fills 47 degrees, and lies beyond the
 * head's least range. Where that distance is too long for the head's range, the head stands nearer. Then its distance
 * from the side of the scene's box is 0.3 of the largest range, plus the least range. */
static double distance_m(const struct survey *s, const double toward[3])
{
    const struct viewpoint_view *v = s->view;
    double far_m = fmax(2.5 * s->radius_m, s->radius_m + 1.3 * v->range_min_m), half_m = 0.0;
    for (int i = 0; i < 3; i++)
        half_m += 0.5 * s->size_m[i] * fabs(toward[i]);
    return fmin(far_m, half_m + 0.3 * v->range_max_m + v->range_min_m);
}

/* Sets heading, pan and lines of a place, so that its view just holds the survey's bounds, with a margin. ahead_rad is
 * the azimuth from the place to their centre. */
static void frame(const struct survey *s, double ahead_rad, struct viewpoint *at)
{
    const double *p = at->position_m;
    double low[3], high[3];
    for (int i = 0; i < 3; i++) {
        low[i] = s->centre_m[i] - 0.5 * s->size_m[i];
        high[i] = s->centre_m[i] + 0.5 * s->size_m[i];
    }
    double left = 0.0, right = 0.0, near_m[2], far_m = 0.0;
    for (int i = 0; i < 4; i++) {
        double x = (i & 1 ? high : low)[0] - p[0], y = (i & 2 ? high : low)[1] - p[1];
        double turn = remainder(atan2(x, y) - ahead_rad, 2.0 * M_PI);
        left = fmin(left, turn);
        right = fmax(right, turn);
        far_m = fmax(far_m, hypot(x, y));
    }
    for (int i = 0; i < 2; i++)
        near_m[i] = fmax(fmax(low[i] - p[i], p[i] - high[i]), 0.0);
    double near = hypot(near_m[0], near_m[1]), up = high[2] - p[2], below = low[2] - p[2];
    double margin = angle_rad(1.0) + 0.03 * (right - left);
    at->heading_rad = ahead_rad + left - margin;
    at->pan_rad = fmin(right - left + 2.0 * margin, 2.0 * M_PI);
    at->line0_rad = fmax(atan2(below, below < 0.0 ? near : far_m) - margin, s->view->line_min_rad);
    at->line1_rad = fmin(atan2(up, up > 0.0 ? near : far_m) + margin, fmin(s->view->line_max_rad, M_PI_2));
}

/* Casts rays over the pan and line angles of a viewpoint, and returns figures of their hits. */
static struct survey_sight outside_look(struct survey *s, const struct viewpoint *at)
{
    survey_clear(s);
    for (int i = 0; i < GRID * GRID; i++) {
        double dir[3], across = (i % GRID + 0.5) / GRID, up = (i / GRID + 0.5) / GRID;
        survey_direction(at->heading_rad + at->pan_rad * across, at->line0_rad + (at->line1_rad - at->line0_rad) * up,
                         dir);
        survey_add(s, at->position_m, dir);
    }
    survey_cast(s);
    return survey_look(s, 0, GRID * GRID);
}

int survey_outside(struct survey *s, struct viewpoint *out)
{
    double best = -1.0;
    for (int k = 0; k < SIDES * HEIGHTS; k++) {
        struct viewpoint at = {.kind = VIEWPOINT_OUTSIDE, .floor_m = NAN};
        double ahead = angle_rad(side_deg[k % SIDES]), toward[3];
        survey_direction(ahead, -angle_rad(height_deg[k / SIDES]), toward);
        double away_m = distance_m(s, toward);
        for (int i = 0; i < 3; i++)
            at.position_m[i] = s->centre_m[i] - away_m * toward[i];
        frame(s, ahead, &at);
        if (!(at.line1_rad > at.line0_rad)) continue;
        struct survey_sight sight = outside_look(s, &at);
        double liked = height_worth[k / SIDES] * side_worth[k % SIDES] * (0.5 + 0.5 * sight.front);
        double value = sight.seen * at.pan_rad * (at.line1_rad - at.line0_rad) * liked;
        if (s->is_part) value *= sight.front; /* a place between bodies, not within one */
        if (value <= best) continue;
        best = value;
        *out = at;
        out->seen = sight.seen;
    }
    return best >= 0.0;
}

/* ---- a part of the scene */

struct cells {
    uint32_t n[2];
    double size_m;
    double *area_m2;
};

static uint32_t cell_of(const struct survey *s, const struct cells *c, const double corner[3][3])
{
    uint32_t at[2];
    for (int k = 0; k < 2; k++) {
        const double middle = (corner[0][k] + corner[1][k] + corner[2][k]) / 3.0 - s->scene->min_m[k];
        at[k] = (uint32_t)fmin(fmax(floor(middle / c->size_m), 0.0), c->n[k] - 1.0);
    }
    return at[1] * c->n[0] + at[0];
}

static void outside_fill(const struct survey *s, struct cells *c)
{
    for (uint32_t i = 0; i < s->scene->n_all; i++) {
        double corner[3][3], n[3];
        scene_corners(s->scene, i, corner);
        vec3_normal(corner[0], corner[1], corner[2], n);
        c->area_m2[cell_of(s, c, (const double(*)[3])corner)] += 0.5 * vec3_length(n);
    }
}

/* Returns the cell with the most surface; among equals, up to rounding, the one nearest to the middle. */
static uint32_t find_fullest(const struct cells *c)
{
    uint32_t best = 0;
    double best_aside = INFINITY, most_m2 = 0.0;
    for (uint32_t i = 0; i < c->n[0] * c->n[1]; i++)
        most_m2 = fmax(most_m2, c->area_m2[i]);
    for (uint32_t i = 0; i < c->n[0] * c->n[1]; i++) {
        const double aside = hypot(i % c->n[0] + 0.5 - 0.5 * c->n[0], (double)(i / c->n[0]) + 0.5 - 0.5 * c->n[1]);
        if (c->area_m2[i] < most_m2 * (1.0 - 1e-6) || aside >= best_aside) continue;
        best = i;
        best_aside = aside;
    }
    return best;
}

/* Gives the survey the bounds of the surface in that cell. */
static void narrow(struct survey *s, const struct cells *c, uint32_t cell)
{
    double low[3], high[3];
    vec3_bound_nothing(low, high);
    for (uint32_t i = 0; i < s->scene->n_all; i++) {
        double corner[3][3];
        scene_corners(s->scene, i, corner);
        if (cell_of(s, c, (const double(*)[3])corner) != cell) continue;
        for (int v = 0; v < 3; v++)
            vec3_bound(low, high, corner[v]);
    }
    vec3_sub(high, low, s->size_m);
    for (int k = 0; k < 3; k++)
        s->centre_m[k] = low[k] + 0.5 * s->size_m[k];
    s->radius_m = 0.5 * vec3_length(s->size_m);
    s->is_part = 1;
}

int survey_narrow(struct survey *s, struct sh_err *err)
{
    enum { MOST_CELLS = 64 };
    struct cells c = {.size_m = 0.25 * s->view->range_max_m};
    for (int k = 0; k < 2; k++)
        c.size_m = fmax(c.size_m, s->size_m[k] / MOST_CELLS);
    for (int k = 0; k < 2; k++)
        c.n[k] = (uint32_t)fmax(ceil(s->size_m[k] / c.size_m), 1.0);
    c.area_m2 = calloc((size_t)c.n[0] * c.n[1], sizeof *c.area_m2);
    if (c.area_m2 == NULL) return sh_fail(err, SH_ENOMEM, "no memory to look for a part of the scene");
    outside_fill(s, &c);
    narrow(s, &c, find_fullest(&c));
    free(c.area_m2);
    return SH_OK;
}
