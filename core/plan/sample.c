/* SPDX-License-Identifier: MIT */
/* Draws pulses of the head by chance, and casts them with a method and with the reference. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/mat3.h"
#include "core/plan.h"
#include "core/plan/cost.h"
#include "core/rng.h"
#include "core/sight.h"
#include "core/vec3.h"

/* Rays whose ranges differ by more do not hit one smooth surface: at 80 deg, 100 m and 0.35 mrad, the mean over a
 * footprint differs from its centre by 17 um (core/footprint.h). */
static const double SMOOTH_M = 5e-5;

enum {
    MAX_DRAWN = 32768,  /* pulses */
    MIXED_LOOKS = 1024, /* the most pulses with several smooth surfaces that are cast with the reference */
    PLAIN_LOOKS = 1024, /* the most other pulses that are cast with it */
    PLAIN_EVERY = 8,    /* one of this many other pulses is taken */
    PROBE_RINGS = 4,
    OPTICS_DRAWN = 8192,
    TRIES = 1 << 23, /* the most draws, a second or two in all: a narrow field of view rejects most */
    ROOM = 64,       /* in the block; more than LINE_MAX_ECHOES */
    SIGHT_DRAWN = 1024,
    SIGHT_RAYS = 5, /* to the middle of a cell, and to its corners */
    SIGHT_FEW = 3,  /* the most triangles of a cell that count as a few */
};

struct echoes {
    uint32_t n;
    double range_m[LINE_MAX_ECHOES];
    uint32_t last_label;
};

struct look {
    uint32_t place;
    /* The pulse hits more than one smooth surface. In the sample of the optics: its light goes on beyond
     * CAST_MAX_DEPTH surfaces. */
    int mixed;
    uint64_t pulse;
    struct echoes reference;
};

struct plan_sample {
    struct plan_places places;
    const struct sh_report *report;
    struct caster *caster;
    struct line_block block;
    uint64_t key, tries, found; /* found: the tries within the field of view */
    int tries_ended;
    struct look *look; /* of the beam */
    uint32_t n_looks;
    uint64_t drawn, plain, mixed_looks, plain_looks;
    /* The sample of the optics, whose references follow light through up to CAST_MAX_DEPTH surfaces. */
    struct look *way;
    uint32_t n_ways;
};

int plan_sample_create(const struct plan_places *places, const struct sh_report *report, struct plan_sample **out,
                       struct sh_err *err)
{
    struct plan_sample *s = *out = calloc(1, sizeof *s);
    if (s == NULL) return sh_fail(err, SH_ENOMEM, "plan: no memory");
    *s = (struct plan_sample){.places = *places, .report = report, .key = rng_key(1, RNG_PLAN)};
    s->look = calloc(MIXED_LOOKS + PLAIN_LOOKS, sizeof *s->look);
    s->way = calloc(OPTICS_DRAWN, sizeof *s->way);
    int rc = s->look != NULL && s->way != NULL ? SH_OK : sh_fail(err, SH_ENOMEM, "plan: no memory");
    if (rc == SH_OK) rc = caster_create(&s->caster, err);
    if (rc == SH_OK) rc = line_block_alloc(&s->block, ROOM, err);
    if (rc != SH_OK) {
        plan_sample_free(s);
        *out = NULL;
    }
    return rc;
}

void plan_sample_free(struct plan_sample *s)
{
    if (s == NULL) return;
    caster_free(s->caster);
    line_block_free(&s->block);
    free(s->look);
    free(s->way);
    free(s);
}

static void say_tries_ended(struct plan_sample *s)
{
    if (s->tries_ended) return;
    s->tries_ended = 1;
    sh_warn(s->report,
            "the plan drew %d pulses, but only %llu of them lie within the field of view: so its bounds are wider",
            TRIES, (unsigned long long)s->found);
}

/* Draws the next pulse that is cast. Returns 0 where none is found. */
static int draw(struct plan_sample *s, struct look *look)
{
    while (s->tries < TRIES) {
        uint64_t number = s->tries++;
        if ((number & 0xfff) == 0 && sh_stopped(s->report)) return 0;
        look->place = (uint32_t)(number % s->places.n);
        const struct plan_place *p = &s->places.place[look->place];
        struct schedule_line line;
        look->pulse = p->segment.k0 + rng_u64(s->key, number) % p->pulses;
        schedule_get_line(&p->segment, schedule_line_of(&p->segment, look->pulse), &line);
        if (line.cast0 <= look->pulse && look->pulse < line.cast_end) {
            s->found++;
            return 1;
        }
    }
    say_tries_ended(s);
    return 0;
}

/* Casts one pulse with this setup. */
static void cast_look(struct plan_sample *s, struct cast_setup *setup, const struct look *look, struct echoes *out)
{
    const struct plan_place *p = &s->places.place[look->place];
    const struct line_block *b = &s->block;
    struct schedule_line line;
    struct schedule_run run;
    schedule_get_line(&p->segment, schedule_line_of(&p->segment, look->pulse), &line);
    schedule_get_run(&p->segment, &line, look->pulse, 1, &run);
    if (p->enter != NULL) p->enter(p->ctx, run.t0_ns, setup);
    caster_cast(s->caster, setup, &run, &s->block);
    out->n = b->echo[0] >> 4;
    for (uint32_t i = 0; i < out->n; i++)
        out->range_m[i] = setup->range_scale_m * b->a[i];
    out->last_label = out->n != 0 ? b->label[out->n - 1] : LINE_LABEL_NONE;
}

/* The run's setup made exact: ranges in their finest counts, no noise, sharp thresholds. */
struct exact {
    struct cast_setup setup;
    struct cast_detect detect;
    struct detect_signal signal;
};

static void sample_set_up(const struct plan_place *p, struct exact *e)
{
    struct cast_setup *setup = &e->setup;
    *setup = p->setup;
    setup->layout = LINE_POLAR;
    setup->range_scale_m = fmax(1e-6, setup->range_max_m * 1.1 / 0x1p31);
    setup->noise_on = 0;
    setup->echoes = BEAM_ALL;
    if (setup->detect == NULL) return;
    e->detect = *setup->detect;
    setup->detect = &e->detect;
    e->detect.noise_by_signal = 0;
    e->detect.ball = NULL;
    if (e->detect.signal == NULL) return;
    e->signal = *e->detect.signal;
    e->signal.per_snr = 0.0;
    e->detect.signal = &e->signal;
}

static void cast_beam(struct plan_sample *s, const struct look *look, enum beam_mode mode, struct echoes *out)
{
    const struct plan_place *p = &s->places.place[look->place];
    struct exact e;
    sample_set_up(p, &e);
    e.setup.beam = mode == BEAM_SINGLE ? NULL : p->beam;
    if (e.setup.beam != NULL) p->beam->mode = mode;
    cast_look(s, &e.setup, look, out);
}

static void set_rings(const struct plan_sample *s, uint32_t rings)
{
    for (uint32_t i = 0; i < s->places.n; i++)
        beam_rings(rings, &s->places.place[i].beam->pattern);
}

static int is_mixed(struct plan_sample *s, const struct look *look)
{
    struct echoes centre, all;
    cast_beam(s, look, BEAM_SINGLE, &centre);
    cast_beam(s, look, BEAM_RINGS, &all);
    if (centre.n != all.n) return 1;
    return all.n > 1 || (all.n == 1 && !(fabs(all.range_m[0] - centre.range_m[0]) < SMOOTH_M));
}

static void draw_looks(struct plan_sample *s)
{
    struct look look;
    while (s->mixed_looks < MIXED_LOOKS && s->drawn < MAX_DRAWN && draw(s, &look)) {
        s->drawn++;
        look.mixed = is_mixed(s, &look);
        if (look.mixed) {
            s->mixed_looks++;
        } else {
            if (s->plain++ % PLAIN_EVERY != 0 || s->plain_looks == PLAIN_LOOKS) continue;
            s->plain_looks++;
        }
        s->look[s->n_looks++] = look;
    }
}

static void prepare_beam(struct plan_sample *s)
{
    if (s->n_looks != 0) return;
    set_rings(s, PROBE_RINGS);
    draw_looks(s);
    set_rings(s, BEAM_MAX_RINGS);
    for (uint32_t i = 0; i < s->n_looks && !sh_stopped(s->report); i++)
        cast_beam(s, &s->look[i], BEAM_RINGS, &s->look[i].reference);
}

/* The sums over the sample. Each mixed pulse stands for itself, each other one for many. */
struct tally {
    double echoes, secondary;        /* secondary: beyond the first of a pulse */
    double sum2, sum4;               /* of range errors, squared, and to the fourth power */
    double wrong_mixed, wrong_plain; /* pulses with another number of echoes */
};

static void sample_compare(struct tally *t, const struct echoes *got, const struct echoes *want, double weight,
                           int mixed)
{
    t->secondary += got->n > 1 ? weight * (got->n - 1) : 0.0;
    if (got->n != want->n) *(mixed ? &t->wrong_mixed : &t->wrong_plain) += weight;
    for (uint32_t i = 0; got->n == want->n && i < got->n; i++) {
        double error = got->range_m[i] - want->range_m[i], error2 = error * error;
        t->echoes += weight;
        t->sum2 += weight * error2;
        t->sum4 += weight * weight * error2 * error2;
    }
}

/* Upper limit, at 95 %, of a Poisson mean where `found` were counted: half the quantile of chi-squared with
 * 2 found + 2 degrees of freedom, after Wilson and Hilferty (1931). */
static double poisson_limit(double found)
{
    double k = found + 1.0, root = 1.0 - 1.0 / (9.0 * k) + 1.645 / (3.0 * sqrt(k));
    return k * root * root * root;
}

static void conclude(const struct tally *t, double pulses, struct plan_option *option)
{
    option->error_m = option->echo_share = (double)NAN;
    if (!(pulses > 0.0)) return;
    option->echo_share = fmin(1.0, (poisson_limit(t->wrong_mixed) + t->wrong_plain) / pulses);
    option->error_m = t->echoes > 0.0 ? sqrt((t->sum2 + 3.0 * sqrt(t->sum4)) / t->echoes) : 0.0;
}

void plan_sample_beam(struct plan_sample *s, struct plan_option *option)
{
    struct cast_counters before, after;
    struct tally tally = {0};
    struct echoes got;
    double outlined = 0.0, sub_rays = 0.0;
    prepare_beam(s);
    set_rings(s, option->rings);
    double plain_weight = s->plain_looks != 0 ? (double)s->plain / (double)s->plain_looks : 0.0;
    caster_get_counters(s->caster, &before);
    for (uint32_t i = 0; i < s->n_looks && !sh_stopped(s->report); i++) {
        const struct look *look = &s->look[i];
        double weight = look->mixed ? 1.0 : plain_weight;
        cast_beam(s, look, option->mode, &got);
        sample_compare(&tally, &got, &look->reference, weight, look->mixed);
        caster_get_counters(s->caster, &after);
        outlined += weight * (double)(after.outlined - before.outlined);
        sub_rays += weight * (double)(after.sub_rays - before.sub_rays);
        before = after;
    }
    double pulses = (double)s->drawn;
    conclude(&tally, pulses, option);
    if (option->mode != BEAM_ADAPTIVE || !(pulses > 0.0)) return;
    option->cost_ns = PLAN_COST_OUTLINES + outlined / pulses * PLAN_COST_CUT + sub_rays / pulses * PLAN_COST_SUB_RAY;
}

/* ---- glass and mirrors */

/* apart: each surface on the way is an echo of its own. */
static void cast_way(struct plan_sample *s, const struct look *look, uint32_t depth, int apart, struct echoes *out)
{
    struct exact e;
    sample_set_up(&s->places.place[look->place], &e);
    e.setup.beam = NULL;
    e.detect.depth = depth;
    if (apart) {
        e.detect.signal = NULL;
        e.detect.separation_m = 0.0;
        e.detect.max_echoes = LINE_MAX_ECHOES;
    }
    cast_look(s, &e.setup, look, out);
}

/* Whether light goes on beyond the last echo: its surface, seen directly or as a ghost, is glass or a mirror. */
static int leads_on(const struct plan_sample *s, const struct echoes *e)
{
    const struct cast_detect *d = s->places.place[0].setup.detect;
    const struct surface_table *t = d->surfaces;
    uint32_t label = e->last_label;
    if (label == LINE_LABEL_NONE) return 0;
    if (label >= t->n && d->ghost_label != 0) label -= d->ghost_label;
    return label < t->n && (t->surface[label].glass > 0.0 || t->surface[label].mirror > 0.0);
}

void plan_sample_optics(struct plan_sample *s, uint32_t depth, struct plan_option *option)
{
    struct tally tally = {0};
    struct echoes got;
    while (s->n_ways < OPTICS_DRAWN && draw(s, &s->way[s->n_ways])) {
        struct look *way = &s->way[s->n_ways++];
        cast_way(s, way, CAST_MAX_DEPTH, 1, &way->reference);
        way->mixed = way->reference.n > CAST_MAX_DEPTH && leads_on(s, &way->reference);
        cast_way(s, way, CAST_MAX_DEPTH, 0, &way->reference);
    }
    for (uint32_t i = 0; i < s->n_ways && !sh_stopped(s->report); i++) {
        const struct look *way = &s->way[i];
        cast_way(s, way, depth, 0, &got);
        sample_compare(&tally, &got, &way->reference, 1.0, 1);
        if (got.n == way->reference.n && way->mixed) tally.wrong_mixed += 1.0;
    }
    conclude(&tally, s->n_ways, option);
    option->cost_ns = depth == 0 ? 0.0 : PLAN_COST_SUB_RAY * tally.secondary / s->n_ways;
}

/* ---- sight */

/* Makes unit vectors to a pulse's direction, and to the corners of a square around it. */
static void square_around(const struct plan_place *p, uint64_t pulse, double across_rad, double d[3][SIGHT_RAYS])
{
    const double pan = 2.0 * M_PI * schedule_pan_turn(&p->segment, pulse), half = 0.5 * across_rad;
    const double mirror = 2.0 * M_PI * schedule_mirror_turn(&p->segment, pulse);
    const double right[3] = {cos(pan), -sin(pan), 0.0};
    const double ahead[3] = {sin(pan) * cos(mirror), cos(pan) * cos(mirror), sin(mirror)};
    const double up[3] = {-sin(pan) * sin(mirror), -cos(pan) * sin(mirror), cos(mirror)};
    for (int i = 0; i < SIGHT_RAYS; i++) {
        const double a = i == 0 ? 0.0 : i & 1 ? half : -half, b = i == 0 ? 0.0 : i & 2 ? half : -half;
        double s[3], v[3];
        for (int k = 0; k < 3; k++)
            s[k] = (ahead[k] + a * right[k] + b * up[k]) / sqrt(1.0 + a * a + b * b);
        mat3_apply(p->setup.rotation, s, v);
        for (int k = 0; k < 3; k++)
            d[k][i] = v[k];
    }
}

static uint32_t count_different(const uint32_t *triangle)
{
    uint32_t n = 0;
    for (int i = 0; i < SIGHT_RAYS; i++) {
        int k = 0;
        while (triangle[k] != triangle[i])
            k++;
        n += k == i;
    }
    return n;
}

/* Returns how many of `rays` rays in all directions hit the middle ray's triangle, unless it is hidden. */
static double rays_on(const struct bvh *bvh, const struct bvh_rays *cast, double rays)
{
    struct bvh_plane plane;
    const double dir[3] = VEC3_AT(cast->dir, 0), range_m = cast->range_m[0];
    bvh_get_plane(bvh, cast->triangle[0], &plane);
    const double across_m2 = 0.5 * fabs(vec3_dot(plane.n, dir));
    return rays * across_m2 / (4.0 * M_PI * range_m * range_m);
}

/* Counts a pulse's cell under its kind. */
static void count_cell(const struct bvh *bvh, const struct bvh_rays *cast, double rays, struct plan_sight_found *found)
{
    const uint32_t kinds = count_different(cast->triangle);
    const double hit_by = cast->triangle[0] != BVH_NO_TRIANGLE ? rays_on(bvh, cast, rays) : INFINITY;
    if (hit_by < SIGHT_GROUP_RAYS) {
        found->small += 1.0;
        return;
    }
    found->per_pulse += 1.0 / hit_by;
    *(kinds > SIGHT_FEW                      ? &found->ask
      : kinds > 1                            ? &found->few
      : cast->triangle[0] == BVH_NO_TRIANGLE ? &found->nothing
                                             : &found->one) += 1.0;
}

static double examined(const struct plan_sample *s, double rays)
{
    const struct cast_setup *setup = &s->places.place[0].setup;
    struct sight_spec spec = {.bvh = setup->bvh, .rays = rays};
    memcpy(spec.station_m, setup->station_m, sizeof spec.station_m);
    return sight_examined(&spec);
}

void plan_sample_sight(struct plan_sample *s, double cell_rad, double all_rays, struct plan_sight_found *found)
{
    struct look look;
    double d[3][SIGHT_RAYS], range_m[SIGHT_RAYS];
    uint32_t triangle[SIGHT_RAYS], n = 0;
    memset(found, 0, sizeof *found);
    for (; n < SIGHT_DRAWN && draw(s, &look); n++) {
        const struct plan_place *p = &s->places.place[look.place];
        const double *at_m = p->setup.station_m;
        const struct bvh_rays rays = {.n = SIGHT_RAYS,
                                      .from.at_m = {at_m[0], at_m[1], at_m[2]},
                                      .dir = {d[0], d[1], d[2]},
                                      .range_max_m = p->setup.range_max_m,
                                      .range_m = range_m,
                                      .triangle = triangle};
        square_around(p, look.pulse, cell_rad, d);
        caster_hits(s->caster, p->setup.bvh, &rays);
        count_cell(p->setup.bvh, &rays, all_rays, found);
    }
    if (n == 0) found->ask = n = 1; /* without a sample the map must not seem to pay */
    found->few += 0.5 * found->ask; /* lists decide about half of the cells that seem to need the BVH */
    found->ask *= 0.5;
    *found = (struct plan_sight_found){found->one / n,   found->nothing / n,   found->few / n,       found->ask / n,
                                       found->small / n, found->per_pulse / n, examined(s, all_rays)};
}
