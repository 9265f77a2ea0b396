/* SPDX-License-Identifier: MIT */
/* The way of a pulse, from its place in the schedule to a point. cast_chunk has the stages in their order:
 *
 *     aim        aim.c            angles -> where the beam goes and begins, and what the encoders read of it
 *     nearest    nearest.c        the first surface that the beam's centre hits, of the scene and of bodies that
 *                                 move; exact (core/bvh.h)
 *     tripod     tripod.c         pulses that the tripod below the head hides
 *     optics     optics.c         where this surface is glass or a mirror: the surfaces seen in it
 *                                 (caster_follow)
 *     sub-rays   sub_rays.c       pulses with a footprint: which of them need more rays, and their echoes;
 *                sub_ray_plan.c   where in a footprint those rays lie
 *     waves      waves.c          the light of a pulse over time, and echoes found in it, where the setup has
 *                                 waveforms; the echoes stage calls it
 *     disturb    disturbance.c    where the head has a disturbance: wobbles and a slipped pan within aim, a dark
 *                                 laser after it, a soiled window within echoes
 *     echoes     echoes.c         which returns are echoes, how they merge, their noise, which of them are sent
 *     points     points.c         positions, and entries of the block
 *
 * A stage that a setup does not need costs nothing. kernels_*.c hold the arithmetic of the stages, texels.c
 * looks up textures, colours.c computes other colours. outlines.c finds outlines before a scan. */
#include "core/cast.h"

#include <stdlib.h>
#include <string.h>

#include "core/cast/ahead.h"
#include "core/cast/aim.h"
#include "core/cast/caster.h"
#include "core/cast/kernels_times.h"
#include "core/cast/points.h"
#include "core/cast/sub_rays.h"
#include "core/cast/tripod.h"
#include "core/cast/disturbance.h"
#include "core/cast/waves.h"

void caster_set_profile(struct caster *caster, struct bvh_profile *profile)
{
    _Static_assert((int)CAST_STAGES <= (int)(sizeof profile->spent / sizeof profile->spent[0]), "room");
    caster->profile = profile;
    bvh_work_set_profile(caster->nearest.bvh, profile);
}

int caster_create(struct caster **out, struct sh_err *err)
{
    struct caster *c = *out = aligned_alloc(64, (sizeof *c + 63) / 64 * 64);
    if (c == NULL) return sh_fail(err, SH_ENOMEM, "cast: no memory for a caster");
    c->nearest.bvh = NULL; /* the arrays are not touched until they are needed */
    c->nearest.sight = NULL;
    c->sub_rays = NULL;
    c->waves = NULL;
    c->ahead = NULL;
    c->profile = NULL;
    c->steps.ready = 0;
    memset(&c->counters, 0, sizeof c->counters);
    int rc = bvh_work_create(&c->nearest.bvh, err);
    if (rc == SH_OK) rc = sight_work_create(&c->nearest.sight, err);
    if (rc == SH_OK) c->sub_rays = aligned_alloc(64, (sizeof *c->sub_rays + 63) / 64 * 64); /* not touched, either */
    if (rc == SH_OK && c->sub_rays == NULL) rc = sh_fail(err, SH_ENOMEM, "cast: no memory for a caster");
    if (rc == SH_OK) return SH_OK;
    caster_free(c);
    *out = NULL;
    return rc;
}

void caster_free(struct caster *caster)
{
    if (caster == NULL) return;
    bvh_work_free(caster->nearest.bvh);
    sight_work_free(caster->nearest.sight);
    free(caster->sub_rays);
    free(caster->waves);
    ahead_free(caster->ahead);
    free(caster);
}

int caster_add_waves(struct caster *caster, struct sh_err *err)
{
    caster->waves = malloc(sizeof *caster->waves);
    return caster->waves != NULL ? SH_OK : sh_fail(err, SH_ENOMEM, "cast: no memory for waveforms");
}

void caster_get_counters(const struct caster *caster, struct cast_counters *counters)
{
    const struct bvh_counters *bvh = bvh_work_counters(caster->nearest.bvh);
    const struct sight_counters *sight = sight_work_counters(caster->nearest.sight);
    *counters = caster->counters;
    counters->decided = bvh->decided;
    counters->few = sight->few;
    counters->asked = sight->asked;
}

void caster_hits(struct caster *caster, const struct bvh *bvh, const struct bvh_rays *rays)
{
    bvh_hits(caster->nearest.bvh, bvh, rays);
}

/* Sets the pulses' places in the list, before rays are cast. */
static void begin_echoes(struct echo_list *l, const struct chunk *k)
{
    l->n = k->n;
    l->n_secondary = 0;
    if (k->s->detect != NULL || k->s->noise_on) memset(l->number, 0, k->n);
    for (uint32_t i = 0; i < k->n && k->attributes; i++)
        l->width_m[i] = (float)k->s->pulse_m;
}

struct ray_hits caster_centres(struct caster *c, const struct chunk *k, int bodies)
{
    const struct cast_setup *s = k->s;
    return (struct ray_hits){.rays = {.n = k->n,
                                      .from = k->from,
                                      .dir = VEC3_IN(c->d, 0),
                                      .range_max_m = s->range_max_m,
                                      .range_m = c->list.range_m,
                                      .triangle = c->hit,
                                      .label = c->list.label,
                                      .steep = s->beam != NULL ? c->sub_rays->steep : NULL},
                             .cosine = bodies ? c->list.cosine : NULL,
                             .body = bodies ? c->body : NULL,
                             .colour = k->texels ? c->list.colour : NULL};
}

static void hide(struct caster *c, const struct chunk *k)
{
    c->counters.hidden += caster_hide(k->s->tripod, &VEC3_IN(c->d, 0), k->n, &c->list);
}

/* Returns whether there are waveforms that are sent or searched for echoes. */
static int has_waves(const struct caster *c, const struct chunk *k)
{
    return c->waves != NULL && k->s->waves != NULL && (k->block->waves != NULL || k->s->waves->finds);
}

/* Returns the number of echoes. */
static uint32_t cast_chunk(struct caster *c, struct chunk *k)
{
    const struct cast_setup *s = k->s;
    const int central = s->beam == NULL || s->beam->mode == BEAM_ADAPTIVE; /* rings have no ray for the centre */
    const int surfaces = s->detect != NULL && s->detect->surfaces != NULL && s->beam == NULL;
    const int bodies = surfaces || (k->texels && caster_has_bodies(s)); /* texels need the body that was hit */
    if (c->profile != NULL) c->profile->last = c->profile->now();
    caster_aim(c, k);
    begin_echoes(&c->list, k);
    k->waves = has_waves(c, k);
    if (k->waves) waves_begin(c, k);
    k->spreads = k->attributes || k->waves;
    if (s->disturbance != NULL && s->disturbance->dark) {
        caster_darken(&c->list);
        caster_report(c, k);
        return caster_points(c, k);
    }
    struct ray_hits hits = caster_centres(c, k, bodies);
    hits.known = central && ahead_take(c->ahead, k, c->nearest.bvh, &hits.rays);
    if (central) caster_nearest(&c->nearest, s, &hits);
    if (s->tripod != NULL && s->beam == NULL) hide(c, k);
    if (hits.body != NULL && s->detect != NULL && s->detect->depth > 0) caster_follow(&c->nearest, s, &hits, &c->paths);
    if (s->beam != NULL) caster_sub_rays(c, k);
    if (s->tripod != NULL && s->beam != NULL) hide(c, k);
    caster_echoes(c, k);
    return caster_points(c, k);
}

static void begin_block(struct line_block *block, const struct cast_setup *setup, const struct schedule_run *run)
{
    block->frame = run->frame;
    block->line = run->line;
    block->pulse0 = run->pulse0;
    block->n_pulses = run->n;
    block->t0_ns = run->t0_ns;
    block->line_t0_ns = run->line_t0_ns;
    block->layout = setup->layout;
    if (block->waves != NULL) block->waves->n = block->waves->n_samples = block->waves->n_left_out = 0;
}

uint32_t caster_cast(struct caster *caster, const struct cast_setup *setup, const struct schedule_run *run,
                     struct line_block *block)
{
    struct chunk chunk = {.s = setup, .run = run, .block = block, .attributes = block->width_cns != NULL};
    chunk.colours = block->rgb != NULL && setup->colour != NULL;
    chunk.texels = chunk.colours && setup->colour->scale.mode == COLOUR_TEXTURE;
    uint32_t echoes = 0;
    begin_block(block, setup, run);
    /* Where a pulse may have several entries, the pulses' times first stand at the end of the array. The entries' times
     * are written from its front, and never reach a pulse's time that is still to be read (points.c). */
    int several = setup->beam != NULL || setup->detect != NULL;
    uint32_t *dt_ns = several ? block->dt_ns + block->capacity - run->n : block->dt_ns;
    kernel_times(run, dt_ns);
    for (uint32_t first = 0; first < run->n; first += chunk.n) {
        chunk.first = first;
        chunk.n = CHUNK < run->n - first ? CHUNK : run->n - first;
        chunk.pulse0 = run->pulse0 + first;
        chunk.dt_ns = dt_ns + first;
        echoes += cast_chunk(caster, &chunk);
    }
    block->n_points = chunk.at;
    return echoes;
}

/* ---- lines ahead */

int caster_add_ahead(struct caster *caster, uint32_t pulses, struct sh_err *err)
{
    return ahead_create(pulses, &caster->ahead, err);
}

/* A sphere gains nothing, since the pulses of its rings lie side by side already. Other heads with an emitter gain
 * nothing, either: each of their lines goes in the same directions again. */
uint32_t caster_room_ahead(const struct caster *caster, const struct cast_setup *s, const struct emitter *emitter)
{
    const struct instrument *instrument = s->detect != NULL ? s->detect->instrument : NULL;
    if (caster->ahead == NULL || s->sight != NULL || s->n_knots != 0 || s->disturbance != NULL) return 0;
    if (s->beam != NULL && s->beam->mode != BEAM_ADAPTIVE) return 0;
    if (emitter != NULL) return 0;
    return instrument == NULL || !instrument_has_offset(instrument) ? caster->ahead->room : 0;
}

static void aim_window(struct caster *c, const struct cast_setup *s, const struct schedule_run *run)
{
    for (uint32_t q = 0; q < c->ahead->n_runs; q++) {
        const struct ahead_run *part = &c->ahead->run[q];
        struct chunk k = {
            .s = s, .run = &run[q], .pulse0 = run[q].pulse0 + part->first, .first = part->first, .n = part->in_window};
        if (k.n == 0) continue;
        caster_aim(c, &k);
        ahead_aimed(c->ahead, q, &VEC3_IN(c->d, 0));
    }
}

void caster_look_ahead(struct caster *caster, const struct cast_setup *setup, const struct schedule_run *run,
                       uint32_t n_runs)
{
    struct cast_setup s = *setup;
    s.layout = LINE_POLAR; /* what the encoders read is computed later */
    ahead_begin(caster->ahead, run, n_runs);
    while (caster->ahead->column < caster->ahead->end) {
        const uint32_t pulses = ahead_open_window(caster->ahead);
        aim_window(caster, &s, run);
        ahead_cast(caster->ahead, &s, caster->nearest.bvh, pulses);
    }
}

void caster_forget(struct caster *caster)
{
    if (caster->ahead != NULL) caster->ahead->n_runs = 0;
}
