/* SPDX-License-Identifier: MIT */
/* Finds the hits of pulses, with their triangles, by the first stages of a pulse (caster.c). From the later stages this
 * file takes only one decision: whether a hit makes an echo. */
#include <math.h>

#include "core/cast/aim.h"
#include "core/cast/caster.h"
#include "core/cast/tripod.h"
#include "core/surface.h"
#include "core/vec3.h"

/* The hits that caster_meet returns are collected here. */
struct meeting {
    const struct cast_setup *s;
    const struct chunk *k;
    double period_s;
    struct cast_hit *hit;
    uint32_t n;
};

/* The result of one ray. */
struct seen {
    uint32_t pulse, label, triangle; /* pulse: of the chunk */
    uint8_t body;
    double range_m, cosine, energy;
};

static int is_front(const struct cast_setup *s, const struct seen *seen, const double dir[3])
{
    double n[3];
    caster_normal(s, seen->body, seen->triangle, n);
    return vec3_dot(dir, n) < 0.0;
}

/* Decides as caster_echoes does, for a single echo without noise. */
static int is_reported(const struct meeting *m, const struct seen *seen)
{
    const struct cast_detect *d = m->s->detect;
    double range_m = seen->range_m, rho = 1.0;
    if (!(range_m >= m->s->range_min_m && range_m <= m->s->range_max_m)) return 0;
    if (m->s->silent != NULL && m->s->silent[surface_of_label(seen->label)]) return 0;
    if (d == NULL) return 1;
    if (d->surfaces != NULL) {
        surface_return(d->surfaces, 1, &seen->label, &seen->cosine, &rho);
        rho *= seen->energy;
        if (caster_is_bare(m->s, seen->label, rho)) return 0;
    }
    if (d->signal != NULL && !(detect_amplitude(d->signal, range_m, rho) >= 1.0)) return 0;
    if (d->ambiguity != DETECT_AMBIGUITY_NONE)
        detect_zones(d->ambiguity, m->period_s, d->zones, m->s->range_min_m, 1, &range_m);
    if (d->instrument != NULL) instrument_range(d->instrument, 1, &range_m);
    return range_m > 0.0; /* not for NaN */
}

/* Glass does not refract: hits beyond it are on the same line. */
static void meet_take(struct meeting *m, const struct ray_hits *hits, const struct seen *seen)
{
    const double dir[3] = VEC3_AT(hits->rays.dir, seen->pulse);
    struct cast_hit *hit = &m->hit[m->n];
    if (!is_reported(m, seen)) return;
    bvh_origin_of(&hits->rays.from, seen->pulse, hit->p_m);
    for (int i = 0; i < 3; i++)
        hit->p_m[i] += seen->range_m * dir[i];
    hit->range_m = seen->range_m;
    hit->cosine = seen->cosine;
    hit->pulse = m->k->first + seen->pulse;
    hit->triangle = seen->triangle;
    hit->body = seen->body;
    hit->front = (uint8_t)is_front(m->s, seen, dir);
    m->n++;
}

static void take_paths(struct meeting *m, const struct ray_hits *hits, const struct path_rays *paths, uint32_t i)
{
    for (uint32_t j = paths->first[i]; j != CAST_NO_PATH; j = paths->found[j].next) {
        const struct path_hit *p = &paths->found[j];
        if (p->ghost) continue;
        meet_take(m, hits, &(struct seen){i, p->label, p->triangle, p->body, p->range_m, p->cosine, p->energy});
    }
}

static void meet_chunk(struct caster *c, const struct chunk *k, struct meeting *m)
{
    const struct cast_setup *s = k->s;
    struct ray_hits hits = caster_centres(c, k, 1);
    const int follows = s->detect != NULL && s->detect->surfaces != NULL && s->detect->depth > 0;
    hits.rays.steep = NULL; /* only footprints need it */
    caster_nearest(&c->nearest, s, &hits);
    if (s->tripod != NULL) c->counters.hidden += caster_hide(s->tripod, &VEC3_IN(c->d, 0), k->n, &c->list);
    if (follows) caster_follow(&c->nearest, s, &hits, &c->paths);
    m->k = k;
    for (uint32_t i = 0; i < k->n; i++) {
        if (isnan(hits.rays.range_m[i])) continue;
        meet_take(m, &hits,
                  &(struct seen){i, hits.rays.label[i], hits.rays.triangle[i], hits.body[i], hits.rays.range_m[i],
                                 hits.cosine[i], 1.0});
        if (follows) take_paths(m, &hits, &c->paths, i);
    }
}

uint32_t caster_meet(struct caster *caster, const struct cast_setup *setup, const struct schedule_run *run,
                     struct cast_hit *hit)
{
    struct meeting m = {
        .s = setup, .hit = hit, .period_s = 1e-9 * ((double)run->ns_quot + (double)run->ns_rem / (double)run->ns_den)};
    struct chunk chunk = {.s = setup, .run = run};
    for (uint32_t first = 0; first < run->n; first += chunk.n) {
        chunk.first = first;
        chunk.n = CHUNK < run->n - first ? CHUNK : run->n - first;
        chunk.pulse0 = run->pulse0 + first;
        caster->list.n = chunk.n;
        caster->list.n_secondary = 0;
        caster_aim(caster, &chunk);
        meet_chunk(caster, &chunk, &m);
    }
    return m.n;
}
