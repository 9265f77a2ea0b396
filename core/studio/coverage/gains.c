/* SPDX-License-Identifier: MIT */
/* The area that heads at other places would see and that no station has seen. */
#include <math.h>
#include <stdlib.h>

#include "core/studio/coverage/inside.h"
#include "core/together.h"
#include "core/vec3.h"

static const double LEAST_COSINE = 0.02;

struct gains {
    const struct coverage *c;
    const struct bvh *bvh;
    const struct coverage_directions *directions;
    const struct coverage_places *places;
    const struct sh_report *report;
    struct coverage_gain *gain;
    atomic_uint next;
    atomic_int failed;
};

/* The areas that rays of one place stand for in one cell. */
struct claim {
    double sum_m2, most_m2;
};

struct gain_worker {
    struct gains *g;
    struct bvh_work *work;
    struct claim *claim; /* [n_cells] 0 between places */
    uint32_t *claimed;   /* [directions] cells with a claim */
    uint32_t n_claimed, n_hits, front;
    double x[BVH_CHUNK], y[BVH_CHUNK], z[BVH_CHUNK], range_m[BVH_CHUNK], cosine[BVH_CHUNK];
    uint32_t triangle[BVH_CHUNK];
};

static void claim(struct gain_worker *w, uint32_t cell, double area_m2)
{
    struct claim *c = &w->claim[cell];
    if (c->sum_m2 == 0.0) w->claimed[w->n_claimed++] = cell;
    c->sum_m2 += area_m2;
    c->most_m2 = fmax(c->most_m2, area_m2);
}

static void take_ray(struct gain_worker *w, const double from_m[3], uint32_t i, double sr)
{
    const struct coverage_directions *d = w->g->directions;
    const double range_m = w->range_m[i], dir[3] = VEC3_AT(*w, i);
    double p_m[3];
    if (!(range_m >= d->range_min_m && range_m <= d->range_max_m)) return;
    w->n_hits++;
    w->front += vec3_dot(bvh_plane(w->g->bvh, w->triangle[i])->n, dir) < 0.0;
    for (int k = 0; k < 3; k++)
        p_m[k] = from_m[k] + range_m * dir[k];
    const uint32_t cell = coverage_cell_at(w->g->c, w->triangle[i], p_m);
    if (cell == NO_CELL) return;
    if (w->g->places->cells != NULL) atomic_fetch_or(&w->g->places->cells[cell / 64], 1ULL << cell % 64);
    if (w->g->c->cell[cell].stations != 0) return;
    claim(w, cell, range_m * range_m * sr / fmax(w->cosine[i], LEAST_COSINE));
}

static void cast(struct gain_worker *w, const double from_m[3], uint32_t first, uint32_t n)
{
    const struct coverage_directions *d = w->g->directions;
    for (uint32_t i = 0; i < n; i++)
        VEC3_SET(*w, i, d->dir[first + i]);
    const struct bvh_rays rays = {.n = n,
                                  .from.at_m = {from_m[0], from_m[1], from_m[2]},
                                  .dir = VEC3_IN(*w, 0),
                                  .range_max_m = d->range_max_m,
                                  .range_m = w->range_m,
                                  .triangle = w->triangle};
    bvh_hits(w->work, w->g->bvh, &rays);
    bvh_cosines(w->g->bvh, w->triangle, &rays.dir, n, w->cosine);
    for (uint32_t i = 0; i < n; i++)
        take_ray(w, from_m, i, d->each_sr[first + i]);
}

static void gains_look(struct gain_worker *w, uint32_t place)
{
    const uint32_t n = w->g->directions->n;
    struct coverage_gain *gain = &w->g->gain[place];
    w->n_hits = w->front = w->n_claimed = 0;
    for (uint32_t first = 0; first < n && !sh_stopped(w->g->report); first += BVH_CHUNK)
        cast(w, w->g->places->place_m[place], first, n - first < BVH_CHUNK ? n - first : BVH_CHUNK);
    *gain = (struct coverage_gain){0.0, w->n_hits > 0 ? (double)w->front / w->n_hits : (double)NAN};
    for (uint32_t i = 0; i < w->n_claimed; i++) {
        struct claim *c = &w->claim[w->claimed[i]];
        const double area_m2 = w->g->c->cell[w->claimed[i]].area_m2;
        gain->gain_m2 += c->most_m2 > area_m2 && !isinf(c->most_m2) ? c->sum_m2 : area_m2;
        *c = (struct claim){0.0, 0.0};
    }
}

static void free_worker(struct gain_worker *w)
{
    if (w == NULL) return;
    bvh_work_free(w->work);
    free(w->claim);
    free(w->claimed);
    free(w);
}

static struct gain_worker *make_worker(struct gains *g)
{
    struct sh_err err;
    struct gain_worker *w = calloc(1, sizeof *w);
    if (w == NULL) return NULL;
    w->g = g;
    w->claim = calloc(g->c->n_cells + 1, sizeof *w->claim);
    w->claimed = malloc((g->directions->n + 1) * sizeof *w->claimed);
    if (w->claim != NULL && w->claimed != NULL && bvh_work_create(&w->work, &err) == SH_OK) return w;
    free_worker(w);
    return NULL;
}

static void work_on(void *ctx, int reports)
{
    struct gains *g = ctx;
    struct gain_worker *w = make_worker(g);
    uint32_t place;
    if (w == NULL) atomic_store(&g->failed, 1);
    while (w != NULL && (place = atomic_fetch_add(&g->next, 1)) < g->places->n && !sh_stopped(g->report)) {
        gains_look(w, place);
        if (reports) sh_progress(g->report, "comparing places", (double)(place + 1) / g->places->n);
    }
    free_worker(w);
}

int coverage_gains(const struct coverage *coverage, const struct coverage_directions *directions,
                   const struct coverage_places *places, const struct sh_report *report, struct coverage_gain *gain,
                   struct sh_err *err)
{
    struct gains g = {.c = coverage,
                      .bvh = coverage->spec.bvh,
                      .directions = directions,
                      .places = places,
                      .report = report,
                      .gain = gain};
    together(coverage->spec.threads, work_on, &g);
    int rc = sh_check_stop(report, err);
    if (rc == SH_OK && atomic_load(&g.next) < places->n && atomic_load(&g.failed))
        return sh_fail(err, SH_ENOMEM, "no memory to compare places");
    return rc;
}
