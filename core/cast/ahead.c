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

#include "core/cast/aim.h"
#include "core/cast/caster.h"

int caster_add_ahead(struct caster *caster, uint32_t pulses, struct sh_err *err)
{
    struct cast_ahead *a = caster->ahead = aligned_alloc(64, (sizeof *a + 63) / 64 * 64);
    if (a == NULL) return sh_fail(err, SH_ENOMEM, "cast: no memory for lines ahead");
    a->n_runs = 0;
    a->room = pulses;
    a->range_m = malloc(pulses * sizeof *a->range_m);
    a->triangle = malloc(pulses * sizeof *a->triangle);
    a->label = malloc(pulses * sizeof *a->label);
    a->steep = malloc(pulses * sizeof *a->steep);
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

/* The rings of a sphere gain nothing: their pulses lie side by side already. The next line of other heads with an emitter
 * goes in the same directions once more. */
uint32_t caster_room_ahead(const struct caster *caster, const struct cast_setup *s, const struct emitter *emitter)
{
    const struct instrument *instrument = s->detect != NULL ? s->detect->instrument : NULL;
    if (caster->ahead == NULL || s->sight != NULL || s->n_knots != 0 || s->disturbance != NULL) return 0;
    if (s->beam != NULL && s->beam->mode != BEAM_ADAPTIVE) return 0;
    if (emitter != NULL) return 0;
    return instrument == NULL || !instrument_has_offset(instrument) ? caster->ahead->room : 0;
}

/* ---- a window */

/* A window has pulses of each line. */
struct window {
    uint32_t first[CAST_AHEAD_RUNS], n[CAST_AHEAD_RUNS]; /* of the run; n 0: none */
};

/* Chooses the pulses whose place in their line is column .. column + AHEAD_WINDOW - 1. Returns how many there are. */
static uint32_t open_window(const struct schedule_run *run, uint32_t n_runs, uint64_t column, struct window *w)
{
    uint32_t pulses = 0;
    for (uint32_t q = 0; q < n_runs; q++) {
        const uint64_t begin = run[q].in_line, end = begin + run[q].n, from = column > begin ? column : begin,
                       to = column + AHEAD_WINDOW < end ? column + AHEAD_WINDOW : end;
        w->first[q] = from < to ? (uint32_t)(from - begin) : 0;
        w->n[q] = from < to ? (uint32_t)(to - from) : 0;
        pulses += w->n[q];
    }
    return pulses;
}

/* Returns how many consecutive pulses of a line go into a tile. A tile is about as wide as it is long. Where lines are
 * far apart, its pulses are those of two lines. */
static uint32_t tile_of(const struct schedule_run *run, uint32_t n_runs)
{
    const double pulse_turn = fabs((double)run[0].num * run[0].mirror_turn_per_r),
                 line_turn = n_runs > 1 ? fabs(run[1].pan0_turn - run[0].pan0_turn) : 1.0;
    return line_turn > 2.0 * pulse_turn ? 2 * AHEAD_STEP : AHEAD_STEP;
}

static void aim_window(struct caster *c, const struct schedule_run *run, uint32_t n_runs, const struct window *w)
{
    struct cast_ahead *a = c->ahead;
    for (uint32_t q = 0; q < n_runs; q++) {
        if (w->n[q] == 0) continue;
        struct chunk k = {
            .s = &a->setup, .run = &run[q], .pulse0 = run[q].pulse0 + w->first[q], .first = w->first[q], .n = w->n[q]};
        caster_aim(c, &k);
        memcpy(a->line[q].x, c->d.x, w->n[q] * sizeof(double));
        memcpy(a->line[q].y, c->d.y, w->n[q] * sizeof(double));
        memcpy(a->line[q].z, c->d.z, w->n[q] * sizeof(double));
    }
}

/* Lists the window's pulses tile by tile. */
static void order_window(struct cast_ahead *a, uint32_t n_runs, const struct window *w)
{
    a->n_steps = 0;
    for (uint32_t row = 0, at = 0; row < AHEAD_WINDOW; row += a->tile)
        for (uint32_t q = 0; q < n_runs; q++) {
            const uint32_t end = row + a->tile < w->n[q] ? row + a->tile : w->n[q];
            for (uint32_t i = row; i < end; i += AHEAD_STEP) {
                a->step[a->n_steps++] = (struct ahead_step){q, i, at};
                at += end - i < AHEAD_STEP ? end - i : AHEAD_STEP;
            }
        }
}

/* Each copy has AHEAD_STEP elements, and may go beyond the end of the line's pulses. What it writes there is overwritten
 * by the next copies, or not read. */
static void gather_window(struct cast_ahead *a)
{
    for (uint32_t j = 0; j < a->n_steps; j++) {
        const struct ahead_step t = a->step[j];
        memcpy(a->d.x + t.at, a->line[t.run].x + t.pulse, AHEAD_STEP * sizeof(double));
        memcpy(a->d.y + t.at, a->line[t.run].y + t.pulse, AHEAD_STEP * sizeof(double));
        memcpy(a->d.z + t.at, a->line[t.run].z + t.pulse, AHEAD_STEP * sizeof(double));
    }
}

static void keep_window(struct cast_ahead *a, uint32_t n_runs, const struct window *w)
{
    for (uint32_t j = 0; j < a->n_steps; j++) {
        const struct ahead_step t = a->step[j];
        memcpy(a->line[t.run].range_m + t.pulse, a->tile_range_m + t.at, AHEAD_STEP * sizeof(double));
        memcpy(a->line[t.run].triangle + t.pulse, a->tile_triangle + t.at, AHEAD_STEP * sizeof(uint32_t));
        memcpy(a->line[t.run].label + t.pulse, a->tile_label + t.at, AHEAD_STEP * sizeof(uint32_t));
        memcpy(a->line[t.run].steep + t.pulse, a->tile_steep + t.at, AHEAD_STEP * sizeof(float));
    }
    for (uint32_t q = 0; q < n_runs; q++) {
        const uint32_t at = a->run[q].at + w->first[q];
        memcpy(a->range_m + at, a->line[q].range_m, w->n[q] * sizeof(double));
        memcpy(a->triangle + at, a->line[q].triangle, w->n[q] * sizeof(uint32_t));
        memcpy(a->label + at, a->line[q].label, w->n[q] * sizeof(uint32_t));
        if (a->setup.beam != NULL) memcpy(a->steep + at, a->line[q].steep, w->n[q] * sizeof(float));
    }
}

/* ---- all lines */

static void cast_window(struct caster *c, const struct schedule_run *run, uint32_t n_runs, const struct window *w,
                        uint32_t pulses)
{
    struct cast_ahead *a = c->ahead;
    const struct cast_setup *s = &a->setup;
    const struct bvh_rays rays = {.n = pulses,
                                  .from.at_m = {s->station_m[0], s->station_m[1], s->station_m[2]},
                                  .dir = VEC3_IN(a->d, 0),
                                  .range_max_m = s->range_max_m,
                                  .range_m = a->tile_range_m,
                                  .triangle = a->tile_triangle,
                                  .label = a->tile_label,
                                  .steep = s->beam != NULL ? a->tile_steep : NULL};
    aim_window(c, run, n_runs, w);
    order_window(a, n_runs, w);
    gather_window(a);
    bvh_hits(c->nearest.bvh, s->bvh, &rays);
    keep_window(a, n_runs, w);
}

void caster_look_ahead(struct caster *caster, const struct cast_setup *setup, const struct schedule_run *run,
                       uint32_t n_runs)
{
    struct cast_ahead *a = caster->ahead;
    uint64_t column = UINT64_MAX, end = 0;
    uint32_t at = 0;
    a->setup = *setup;
    a->setup.layout = LINE_POLAR; /* what the encoders read is computed later */
    for (a->n_runs = 0; a->n_runs < n_runs && run[a->n_runs].n <= a->room - at; a->n_runs++) {
        const struct schedule_run *r = &run[a->n_runs];
        a->run[a->n_runs] = (struct ahead_run){r->pulse0, r->n, at};
        at += r->n;
        column = r->in_line < column ? r->in_line : column;
        end = (uint64_t)r->in_line + r->n > end ? (uint64_t)r->in_line + r->n : end;
    }
    if (a->n_runs != 0) a->tile = tile_of(run, a->n_runs);
    for (; column < end; column += AHEAD_WINDOW) {
        struct window w;
        const uint32_t pulses = open_window(run, a->n_runs, column, &w);
        if (pulses != 0) cast_window(caster, run, a->n_runs, &w, pulses);
    }
}

void caster_forget(struct caster *caster)
{
    if (caster->ahead != NULL) caster->ahead->n_runs = 0;
}

int ahead_take(const struct caster *c, const struct chunk *k, const struct bvh_rays *rays)
{
    const struct cast_ahead *a = c->ahead;
    for (uint32_t q = 0; a != NULL && q < a->n_runs; q++) {
        const struct ahead_run *run = &a->run[q];
        if (k->pulse0 < run->pulse0 || k->pulse0 + k->n > run->pulse0 + run->n) continue;
        const size_t at = run->at + (size_t)(k->pulse0 - run->pulse0);
        memcpy(rays->range_m, a->range_m + at, k->n * sizeof(double));
        memcpy(rays->triangle, a->triangle + at, k->n * sizeof(uint32_t));
        memcpy(rays->label, a->label + at, k->n * sizeof(uint32_t));
        if (rays->steep == NULL) return 1;
        memcpy(rays->steep, a->steep + at, k->n * sizeof(float));
        bvh_work_set_directions(c->nearest.bvh, &rays->dir, k->n);
        return 1;
    }
    return 0;
}
