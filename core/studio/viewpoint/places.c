/* SPDX-License-Identifier: MIT */
/* Places on a grid where a tripod can stand. */
#include <math.h>
#include <stdlib.h>

#include "core/digits.h"
#include "core/grow.h"
#include "core/studio/viewpoint/survey.h"
#include "core/vec3.h"

enum { LEGS = 8, LOOKS = 2 * LEGS, TOGETHER = BVH_CHUNK / LOOKS };

static const double LEVEL = 0.9397; /* cosine of a floor's slope, 20 degrees */
static const double ABOVE_M = 0.2, AROUND_M = 0.3, LEVEL_M = 0.15;
/* The rays of a place begin at least so far above its floor: the floor around it may be LEVEL_M higher. ABOVE_M says
 * that there is room for that. */
static const double LEAST_LOOK_M = 0.16;
/* Surfaces are found by rays, with their rounding. Heights in whole millimetres are compared to half of one. */
static const double NEAR_M = 5e-4;

struct search {
    struct survey survey;
    const struct viewpoint_grid *grid;
    const struct sh_report *report;
    struct survey_column column[BVH_CHUNK];
    uint64_t across[2]; /* columns along x, y */
    double first_m[2];  /* of the first one */
    struct viewpoint_place *floor, *place;
    size_t n_floors, floor_room, n_places, place_room;
};

static int places_keep(struct viewpoint_place **list, size_t *n, size_t *room, const struct viewpoint_place *place)
{
    if (!grow(list, room, *n + 1, sizeof **list)) return 0;
    (*list)[(*n)++] = *place;
    return 1;
}

static double to_mm(double m)
{
    return round(1e3 * m) * 1e-3;
}

/* Keeps a surface that is a floor. Returns 0 where there is no memory. */
static int take_surface(void *ctx, uint32_t i, double z_m)
{
    struct search *s = ctx;
    const struct survey_column *c = &s->column[i];
    const struct viewpoint_place floor = {{to_mm(c->x_m), to_mm(c->y_m), to_mm(z_m + s->grid->height_m)}, z_m};
    const int has_room = c->last_m - z_m >= s->grid->height_m + ABOVE_M - NEAR_M;
    const int asked_for = z_m >= s->grid->min_m[2] - NEAR_M && z_m <= s->grid->max_m[2] + NEAR_M;
    if (!has_room || !asked_for || fabs(survey_cosine(&s->survey, i)) < LEVEL) return 1;
    return places_keep(&s->floor, &s->n_floors, &s->floor_room, &floor);
}

static int places_compare(const void *a, const void *b)
{
    const struct viewpoint_place *p = a, *q = b;
    for (int i = 0; i < 2; i++)
        if (p->position_m[i] != q->position_m[i]) return p->position_m[i] < q->position_m[i] ? -1 : 1;
    return (p->position_m[2] < q->position_m[2]) - (p->position_m[2] > q->position_m[2]);
}

/* How far above the head's height the rays of a place begin. */
static double lift_m(const struct search *s)
{
    return fmax(LEAST_LOOK_M - s->grid->height_m, 0.0);
}

/* Adds the rays of one place: down around it, and outward from the head. */
static void add_looks(struct search *s, const struct viewpoint_place *p)
{
    const double at[3] = {p->position_m[0], p->position_m[1], p->position_m[2] + lift_m(s)};
    for (int i = 0; i < LEGS; i++) {
        const double turn = 2.0 * M_PI * i / LEGS, x = sin(turn), y = cos(turn);
        survey_add(&s->survey, (const double[3]){at[0] + AROUND_M * x, at[1] + AROUND_M * y, at[2]}, survey_down);
        survey_add(&s->survey, at, (const double[3]){x, y, 0.0});
    }
}

static int stands(const struct search *s, uint32_t first)
{
    const double height_m = s->grid->height_m + lift_m(s), *range_m = s->survey.rays.range_m + first;
    int level = 0, free_around = 1;
    for (int i = 0; i < LEGS; i++) {
        level += fabs(range_m[2 * i] - height_m) <= LEVEL_M;
        free_around &= !(range_m[2 * i + 1] <= AROUND_M);
    }
    return level >= LEGS - 2 && free_around;
}

static int choose(struct search *s)
{
    for (size_t first = 0; first < s->n_floors && !sh_stopped(s->report); first += TOGETHER) {
        const size_t end = s->n_floors - first < TOGETHER ? s->n_floors : first + TOGETHER;
        survey_clear(&s->survey);
        for (size_t i = first; i < end; i++)
            add_looks(s, &s->floor[i]);
        survey_cast(&s->survey);
        for (size_t i = first; i < end; i++)
            if (stands(s, (uint32_t)(i - first) * LOOKS) &&
                !places_keep(&s->place, &s->n_places, &s->place_room, &s->floor[i]))
                return 0;
    }
    return 1;
}

static int places_find(struct search *s, struct sh_err *err)
{
    const uint64_t all = s->across[0] * s->across[1];
    for (uint64_t first = 0; first < all; first += BVH_CHUNK) {
        const uint32_t n = (uint32_t)(all - first < BVH_CHUNK ? all - first : BVH_CHUNK);
        if (sh_stopped(s->report)) return sh_fail_stopped(err);
        for (uint32_t i = 0; i < n; i++)
            s->column[i] =
                (struct survey_column){s->first_m[0] + (double)((first + i) / s->across[1]) * s->grid->step_m,
                                       s->first_m[1] + (double)((first + i) % s->across[1]) * s->grid->step_m,
                                       s->survey.scene->max_m[2] + 0.01 * s->survey.radius_m + 1e-3, INFINITY};
        if (!survey_descend(&s->survey, s->column, n, s->report, take_surface, s))
            return sh_fail(err, SH_ENOMEM, "no memory for places to stand");
        sh_progress(s->report, "looking for floors", (double)(first + n) / (double)all);
    }
    if (s->n_floors > 0) qsort(s->floor, s->n_floors, sizeof *s->floor, places_compare);
    return choose(s) ? sh_check_stop(s->report, err) : sh_fail(err, SH_ENOMEM, "no memory for places to stand");
}

/* Returns the step with which the grid has as many places as are allowed. A side shorter than a step has one. */
static double least_step_m(const struct viewpoint_grid *g)
{
    const double x_m = g->max_m[0] - g->min_m[0], y_m = g->max_m[1] - g->min_m[1];
    return fmax(sqrt(x_m * y_m / VIEWPOINT_MAX_PLACES), fmax(x_m, y_m) / VIEWPOINT_MAX_PLACES);
}

static int check_grid(struct search *s, struct sh_err *err)
{
    const struct viewpoint_grid *g = s->grid;
    double n[2];
    for (int i = 0; i < 2; i++) /* 0.6 / 0.2 is just below 3 */
        n[i] = fmax(floor((g->max_m[i] - g->min_m[i]) / g->step_m + 1e-9), 1.0);
    if (n[0] * n[1] > VIEWPOINT_MAX_PLACES)
        return sh_fail(err, SH_EINPUT, "a grid of %.0f by %.0f places; allowed are %d: use a step of at least %.2g m",
                       n[0], n[1], VIEWPOINT_MAX_PLACES, digits_up(least_step_m(g), 2));
    for (int i = 0; i < 2; i++) {
        s->across[i] = (uint64_t)n[i];
        s->first_m[i] = 0.5 * (g->min_m[i] + g->max_m[i] - (n[i] - 1.0) * g->step_m);
    }
    return SH_OK;
}

int viewpoint_places(const struct bvh *bvh, const struct viewpoint_grid *grid, const struct sh_report *report,
                     struct viewpoint_place **out, uint32_t *n, struct sh_err *err)
{
    /* Ranges of the head don't count here. */
    static const struct viewpoint_view view = {0};
    struct search *s = calloc(1, sizeof *s);
    *out = NULL;
    *n = 0;
    if (s == NULL) return sh_fail(err, SH_ENOMEM, "no memory for places to stand");
    s->grid = grid;
    s->report = report;
    int rc = check_grid(s, err);
    if (rc == SH_OK) rc = survey_borrow(&s->survey, bvh, &view, err);
    if (rc == SH_OK) rc = places_find(s, err);
    if (rc == SH_OK) {
        *out = s->place;
        *n = (uint32_t)s->n_places;
        s->place = NULL;
    }
    survey_close(&s->survey);
    free(s->floor);
    free(s->place);
    free(s);
    return rc;
}
