/* SPDX-License-Identifier: MIT */
/* Finds the floors of a scene, and tries a viewpoint above each. */
#include <math.h>
#include <stdlib.h>

#include "core/grow.h"
#include "core/studio/viewpoint/survey.h"

enum { COLUMNS = 12, LEGS = 8, AZIMUTHS = 16, LINES = 10, LOOKS = AZIMUTHS * LINES };
enum { N_COLUMNS = COLUMNS * COLUMNS };

static const double HEAD_M = 1.6, LEAST_ROOM_M = 1.5;
static const double LEVEL = 0.7;             /* cosine of a floor's slope, 45 degrees */
static const double LEAST_SEEN_INSIDE = 0.8; /* of the rays, in a room: the others may leave by windows and doors */

struct floor {
    double at_m[3], room_m; /* room above it; INFINITY: the sky */
    double depth_m;         /* from it down to the last surface of its column */
    int front;              /* rays from above hit the front of its triangle */
    uint32_t column;
};

struct floors {
    const struct survey *survey;
    struct survey_column column[N_COLUMNS];
    struct floor *floor;
    size_t n, room;
    uint32_t covered; /* columns that hold anything */
};

static int take_floor(void *ctx, uint32_t i, double z_m)
{
    struct floors *floors = ctx;
    const struct survey_column *c = &floors->column[i];
    const double cosine = survey_cosine(floors->survey, i);
    if (isinf(c->last_m)) floors->covered++;
    if (!(fabs(cosine) >= LEVEL && c->last_m - z_m >= LEAST_ROOM_M)) return 1;
    if (!grow(&floors->floor, &floors->room, floors->n + 1, sizeof *floors->floor)) return 0;
    floors->floor[floors->n++] =
        (struct floor){.at_m = {c->x_m, c->y_m, z_m}, .room_m = c->last_m - z_m, .front = cosine < 0.0, .column = i};
    return 1;
}

/* Finds all floors. Returns 0 where there is no memory. */
static int find_floors(struct survey *s, const struct sh_report *report, struct floors *floors)
{
    for (uint32_t i = 0; i < N_COLUMNS; i++) {
        /* The column is a little beside the middle of its cell, to miss a model's own planes of symmetry. */
        const double x = (i % COLUMNS + 0.537) / COLUMNS, y = ((double)(i / COLUMNS) + 0.537) / COLUMNS;
        floors->column[i] =
            (struct survey_column){s->scene->min_m[0] + s->size_m[0] * x, s->scene->min_m[1] + s->size_m[1] * y,
                                   s->scene->max_m[2] + 0.01 * s->radius_m, INFINITY};
    }
    if (!survey_descend(s, floors->column, N_COLUMNS, report, take_floor, floors)) return 0;
    for (size_t k = 0; k < floors->n; k++) {
        struct floor *f = &floors->floor[k];
        f->depth_m = f->at_m[2] - floors->column[f->column].last_m;
    }
    return 1;
}

static double height_m(const struct survey *s, const struct floor *f)
{
    if (isinf(f->room_m)) return fmin(fmax(HEAD_M, fmax(s->size_m[0], s->size_m[1]) / 200.0), 30.0);
    return fmin(HEAD_M, 0.6 * f->room_m);
}

/* A floor is level and wide enough for a tripod where most of the legs hit the floor's own level. */
static int stands(const struct survey *s, uint32_t first, double height)
{
    int n = 0;
    for (uint32_t i = first; i < first + LEGS; i++)
        n += fabs(s->rays.range_m[i] - height) <= 0.3 * height;
    return n >= LEGS - 2;
}

/* Casts rays as a scan does, evenly in azimuth and in line angle. Each line begins a little further round. */
static struct survey_sight floors_look(struct survey *s, const struct floor *f, double height, int *level)
{
    const double p[3] = {f->at_m[0], f->at_m[1], f->at_m[2] + height};
    const struct viewpoint_view *v = s->view;
    const double line1 = fmin(v->line_max_rad, M_PI_2), leg_m = 0.2 * height;
    survey_clear(s);
    for (int i = 0; i < LEGS; i++) {
        const double turn = 2.0 * M_PI * i / LEGS;
        survey_add(s, (const double[3]){p[0] + leg_m * sin(turn), p[1] + leg_m * cos(turn), p[2]}, survey_down);
    }
    for (int i = 0; i < LOOKS; i++) {
        double dir[3], line = (i / AZIMUTHS + 0.5) / LINES;
        double turn = 2.0 * M_PI * (i % AZIMUTHS + line) / AZIMUTHS;
        survey_direction(turn, v->line_min_rad + (line1 - v->line_min_rad) * line, dir);
        survey_add(s, p, dir);
    }
    survey_cast(s);
    *level = stands(s, 0, height);
    return survey_look(s, LEGS, LOOKS);
}

/* Returns a score that grows with the share of rays that hit something, and a little with the ranges of these hits. The
 * score falls with the place's distance from the scene's middle, and with the place's height in the scene. */
static double score(const struct survey *s, const struct floor *f, const struct survey_sight *sight)
{
    double aside = hypot(f->at_m[0] - s->centre_m[0], f->at_m[1] - s->centre_m[1]) / s->radius_m;
    double high = (f->at_m[2] - s->scene->min_m[2]) / s->radius_m;
    return sight->seen * pow(sight->far_m / s->radius_m, 0.15) * (1.0 - 0.3 * fmin(aside, 1.0)) *
           (1.0 - 0.5 * fmin(high, 1.0));
}

static void floors_keep(struct viewpoint *out, enum viewpoint_kind kind, const struct survey *s, const struct floor *f,
                        double height, double seen)
{
    *out = (struct viewpoint){.kind = kind,
                              .position_m = {f->at_m[0], f->at_m[1], f->at_m[2] + height},
                              .floor_m = height,
                              .seen = seen,
                              .pan_rad = 2.0 * M_PI,
                              .line0_rad = s->view->line_min_rad,
                              .line1_rad = s->view->line_max_rad};
}

/* Land fills its bounds and is much wider than high. */
static int is_land(const struct survey *s, const struct floors *floors)
{
    return s->size_m[2] <= 0.25 * fmin(s->size_m[0], s->size_m[1]) && floors->covered >= 0.7 * N_COLUMNS;
}

/* Open ground is good enough where half of the rays hit something, and where there is no surface far below it: a floor
 * on top of a body has the body's underside below it. On land there is not much to see above the horizon, so a fifth
 * of the rays is enough. */
static int is_good_ground(const struct survey *s, const struct floors *floors, const struct floor *f, double seen)
{
    if (is_land(s, floors)) return seen >= 0.2;
    return seen >= 0.5 && f->depth_m <= fmax(1.0, 0.05 * s->radius_m);
}

static void try(struct survey *s, const struct floors *floors, const struct floor *f, struct survey_best *best)
{
    int level, open = isinf(f->room_m);
    double height = height_m(s, f);
    struct survey_sight sight = floors_look(s, f, height, &level);
    double value = score(s, f, &sight);
    if (!level) return;
    if (!open && sight.seen >= LEAST_SEEN_INSIDE && (sight.front < 0.5 || !f->front)) {
        best->faces_out |= sight.front < 0.1;
        return;
    }
    if (!open && sight.seen >= LEAST_SEEN_INSIDE && value > best->inside_score) {
        best->inside_score = value;
        floors_keep(&best->inside, VIEWPOINT_INSIDE, s, f, height, sight.seen);
    }
    if (open && value > best->ground_score && is_good_ground(s, floors, f, sight.seen)) {
        best->ground_score = value;
        floors_keep(&best->ground, VIEWPOINT_GROUND, s, f, height, sight.seen);
    }
}

int survey_floors(struct survey *s, const struct sh_report *report, struct survey_best *best, struct sh_err *err)
{
    struct floors floors = {.survey = s};
    const int has_room = find_floors(s, report, &floors);
    for (size_t i = 0; i < floors.n && has_room && !sh_stopped(report); i++)
        try(s, &floors, &floors.floor[i], best);
    free(floors.floor);
    return has_room ? sh_check_stop(report, err) : sh_fail(err, SH_ENOMEM, "no memory to look for floors");
}
