/* SPDX-License-Identifier: MIT */
/* Finds first hits of several lines at once, before their pulses are cast.
 *
 * The pulses of a line go in one direction after the other. On ground far away, neighbours of a line hit it metres
 * apart, while pulses of the next line lie close beside them. So packets are tiles here: they hold a few consecutive
 * pulses of each line. A packet then meets fewer leaves than one along the line. The hits are the same, since a hit
 * depends on its ray alone (core/bvh.h). */
#include "core/cast/ahead.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

int ahead_create(uint32_t pulses, struct cast_ahead **out, struct sh_err *err)
{
    struct cast_ahead *a = *out = aligned_alloc(64, (sizeof *a + 63) / 64 * 64);
    if (a == NULL) return sh_fail(err, SH_ENOMEM, "cast: no memory for lines ahead");
    const size_t n = (size_t)pulses + CAST_AHEAD_RUNS * AHEAD_STEP;
    a->n_runs = 0;
    a->room = pulses;
    a->range_m = malloc(n * sizeof *a->range_m);
    a->triangle = malloc(n * sizeof *a->triangle);
    a->label = malloc(n * sizeof *a->label);
    a->steep = malloc(n * sizeof *a->steep);
    if (a->range_m != NULL && a->triangle != NULL && a->label != NULL && a->steep != NULL) return SH_OK;
    return sh_fail(err, SH_ENOMEM, "cast: no memory for %u pulses ahead", pulses);
}

void ahead_free(struct cast_ahead *ahead)
{
    if (ahead == NULL) return;
    free(ahead->range_m);
    free(ahead->triangle);
    free(ahead->label);
    free(ahead->steep);
    free(ahead);
}

/* ---- a window */

/* Returns how many consecutive pulses of a line go into a tile. A tile is about as wide as it is long. Where lines are
 * far apart, its pulses are those of two lines. */
static uint32_t tile_of(const struct schedule_run *run, uint32_t n_runs)
{
    const double pulse_turn = fabs((double)run[0].num * run[0].mirror_turn_per_r),
                 line_turn = n_runs > 1 ? fabs(run[1].pan0_turn - run[0].pan0_turn) : 1.0;
    return line_turn > 2.0 * pulse_turn ? 2 * AHEAD_STEP : AHEAD_STEP;
}

void ahead_begin(struct cast_ahead *a, const struct schedule_run *run, uint32_t n_runs)
{
    uint32_t taken = 0;
    a->column = UINT64_MAX;
    a->end = 0;
    for (a->n_runs = 0; a->n_runs < n_runs && run[a->n_runs].n <= a->room - taken; a->n_runs++) {
        const struct schedule_run *r = &run[a->n_runs];
        const uint32_t at = taken + a->n_runs * AHEAD_STEP;
        a->run[a->n_runs] = (struct ahead_run){.pulse0 = r->pulse0, .column = r->in_line, .n = r->n, .at = at};
        taken += r->n;
        a->column = r->in_line < a->column ? r->in_line : a->column;
        a->end = (uint64_t)r->in_line + r->n > a->end ? (uint64_t)r->in_line + r->n : a->end;
    }
    if (a->n_runs != 0) a->tile = tile_of(run, a->n_runs);
}

uint32_t ahead_open_window(struct cast_ahead *a)
{
    uint32_t pulses = 0;
    for (uint32_t q = 0; q < a->n_runs; q++) {
        struct ahead_run *run = &a->run[q];
        const uint64_t begin = run->column, end = begin + run->n, from = a->column > begin ? a->column : begin,
                       to = a->column + AHEAD_WINDOW < end ? a->column + AHEAD_WINDOW : end;
        run->first = from < to ? (uint32_t)(from - begin) : 0;
        run->in_window = from < to ? (uint32_t)(to - from) : 0;
        pulses += run->in_window;
    }
    a->column += AHEAD_WINDOW;
    return pulses;
}

void ahead_aimed(struct cast_ahead *a, uint32_t q, const struct vec3_in *d)
{
    const size_t bytes = a->run[q].in_window * sizeof(double);
    memcpy(a->line[q].x, d->x, bytes);
    memcpy(a->line[q].y, d->y, bytes);
    memcpy(a->line[q].z, d->z, bytes);
}

/* Lists the window's pulses tile by tile. */
static void order_window(struct cast_ahead *a)
{
    a->n_steps = 0;
    for (uint32_t row = 0, at = 0; row < AHEAD_WINDOW; row += a->tile)
        for (uint32_t q = 0; q < a->n_runs; q++) {
            const uint32_t n = a->run[q].in_window, end = row + a->tile < n ? row + a->tile : n;
            for (uint32_t i = row; i < end; i += AHEAD_STEP) {
                a->step[a->n_steps++] = (struct ahead_step){q, i, at};
                at += end - i < AHEAD_STEP ? end - i : AHEAD_STEP;
            }
        }
}

/* Each copy here and in keep_window has AHEAD_STEP elements, and may go beyond the end of the line's pulses. What it
 * writes there is overwritten by the next copies, or not read. */
static void gather_window(struct cast_ahead *a)
{
    for (uint32_t j = 0; j < a->n_steps; j++) {
        const struct ahead_step t = a->step[j];
        memcpy(a->d.x + t.at, a->line[t.run].x + t.pulse, AHEAD_STEP * sizeof(double));
        memcpy(a->d.y + t.at, a->line[t.run].y + t.pulse, AHEAD_STEP * sizeof(double));
        memcpy(a->d.z + t.at, a->line[t.run].z + t.pulse, AHEAD_STEP * sizeof(double));
    }
}

static void keep_window(struct cast_ahead *a)
{
    for (uint32_t j = 0; j < a->n_steps; j++) {
        const struct ahead_step t = a->step[j];
        const uint32_t to = a->run[t.run].at + a->run[t.run].first + t.pulse;
        memcpy(a->range_m + to, a->tile_range_m + t.at, AHEAD_STEP * sizeof(double));
        memcpy(a->triangle + to, a->tile_triangle + t.at, AHEAD_STEP * sizeof(uint32_t));
        memcpy(a->label + to, a->tile_label + t.at, AHEAD_STEP * sizeof(uint32_t));
        memcpy(a->steep + to, a->tile_steep + t.at, AHEAD_STEP * sizeof(float));
    }
}

void ahead_cast(struct cast_ahead *a, const struct cast_setup *s, struct bvh_work *work, uint32_t pulses)
{
    const struct bvh_rays rays = {.n = pulses,
                                  .from.at_m = {s->station_m[0], s->station_m[1], s->station_m[2]},
                                  .dir = VEC3_IN(a->d, 0),
                                  .range_max_m = s->range_max_m,
                                  .range_m = a->tile_range_m,
                                  .triangle = a->tile_triangle,
                                  .label = a->tile_label,
                                  .steep = s->beam != NULL ? a->tile_steep : NULL};
    order_window(a);
    gather_window(a);
    bvh_hits(work, s->bvh, &rays);
    keep_window(a);
}

int ahead_take(const struct cast_ahead *a, const struct chunk *k, struct bvh_work *work, const struct bvh_rays *rays)
{
    for (uint32_t q = 0; a != NULL && q < a->n_runs; q++) {
        const struct ahead_run *run = &a->run[q];
        if (k->pulse0 < run->pulse0 || k->pulse0 + k->n > run->pulse0 + run->n) continue;
        const size_t at = run->at + (size_t)(k->pulse0 - run->pulse0);
        memcpy(rays->range_m, a->range_m + at, k->n * sizeof(double));
        memcpy(rays->triangle, a->triangle + at, k->n * sizeof(uint32_t));
        memcpy(rays->label, a->label + at, k->n * sizeof(uint32_t));
        if (rays->steep == NULL) return 1;
        memcpy(rays->steep, a->steep + at, k->n * sizeof(float));
        bvh_work_set_directions(work, &rays->dir, k->n);
        return 1;
    }
    return 0;
}
