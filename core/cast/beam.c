/* Pulses with a footprint: central hits, and where they are not all, sub-rays -> echoes -> points. */
#include "core/beam.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/cast/caster.h"
#include "core/rng.h"
#include "core/vec3.h"

enum {
    POOL = 8 * CHUNK, /* sub-rays worked on at a time */
    MAX_JOBS = 256,   /* pulses with sub-rays, likewise */
    MAX_PASSES = 4,
};

/* Sub-rays; those of a job lie together. */
struct pool {
    double px[POOL], py[POOL], pz[POOL], dx[POOL], dy[POOL], dz[POOL];
    double range_m[POOL], cosine[POOL], energy[POOL];
    uint32_t triangle[POOL], label[POOL];
    uint32_t n;
};

/* A pulse that one ray does not do for. */
struct job {
    uint32_t pulse, first, n; /* its sub-rays */
    int again;                /* more outlines have come into play */
    double next_m;            /* the nearest outline that was left out */
    struct beam_return centre; /* known without a ray; energy 0: none */
    double e1[3], e2[3]; /* across the beam */
};

struct beam_work {
    double cosine[CHUNK], limit_m[CHUNK];
    uint32_t near[CHUNK];
    struct job job[MAX_JOBS];
    uint32_t n_jobs;
    struct pool pool;
    struct beam_return returns[BEAM_MAX_SUBRAYS + 1];
    struct beam_echoes some, echoes; /* of pulses with sub-rays; of all */
    /* per pulse, while c holds what is per point */
    double mirror_turn[CHUNK], pan_turn[CHUNK], ex[CHUNK], ey[CHUNK], ez[CHUNK], px[CHUNK], py[CHUNK], pz[CHUNK];
};

int beam_work_create(struct beam_work **out, struct sh_err *err)
{
    struct beam_work *w = *out = aligned_alloc(64, (sizeof *w + 63) / 64 * 64); /* not touched until there is a beam */
    if (w == NULL) return sh_fail(err, SH_ENOMEM, "cast: no memory for a caster");
    memset(&w->some, 0, sizeof w->some);
    memset(&w->echoes, 0, sizeof w->echoes);
    int rc = beam_echoes_alloc(&w->some, CHUNK * (LINE_MAX_ECHOES + 1), err);
    if (rc == SH_OK) rc = beam_echoes_alloc(&w->echoes, CHUNK * (LINE_MAX_ECHOES + 1), err);
    if (rc != SH_OK) {
        beam_work_free(w);
        *out = NULL;
    }
    return rc;
}

void beam_work_free(struct beam_work *w)
{
    if (w == NULL) return;
    beam_echoes_free(&w->some);
    beam_echoes_free(&w->echoes);
    free(w);
}

/* The sub-ray at (x, y) of a pulse's disc. */
static void sub_ray(const struct beam *beam, const double dir[3], const struct job *job, double x, double y,
                    double origin[3], double out[3])
{
    double length2 = 0.0;
    for (int i = 0; i < 3; i++) {
        origin[i] += beam->exit_radius_m * (x * job->e1[i] + y * job->e2[i]);
        out[i] = dir[i] + beam->slope * (x * job->e2[i] - y * job->e1[i]);
        length2 += out[i] * out[i];
    }
    for (int i = 0; i < 3; i++)
        out[i] /= sqrt(length2);
}

static void pulse_origin(const struct origins *from, uint32_t i, double origin[3])
{
    origin[0] = from->px != NULL ? from->px[i] : from->at_m[0];
    origin[1] = from->px != NULL ? from->py[i] : from->at_m[1];
    origin[2] = from->px != NULL ? from->pz[i] : from->at_m[2];
}

static void add_ray(const struct caster *c, const struct beam *beam, const struct origins *from, struct job *job,
                    double x, double y, double energy)
{
    struct pool *pool = &c->beam->pool;
    uint32_t i = pool->n++;
    const double dir[3] = {c->dx[job->pulse], c->dy[job->pulse], c->dz[job->pulse]};
    double origin[3], out[3];
    pulse_origin(from, job->pulse, origin);
    sub_ray(beam, dir, job, x, y, origin, out);
    pool->px[i] = origin[0];
    pool->py[i] = origin[1];
    pool->pz[i] = origin[2];
    pool->dx[i] = out[0];
    pool->dy[i] = out[1];
    pool->dz[i] = out[2];
    pool->energy[i] = energy;
    job->n++;
}

static void add_pattern(const struct caster *c, const struct cast_beam *b, const struct origins *from, struct job *job)
{
    for (uint32_t i = 0; i < b->pattern.n; i++)
        add_ray(c, &b->beam, from, job, b->pattern.x[i], b->pattern.y[i], 1.0 / b->pattern.n);
}

/* The part with the centre lies on the surface that is met there: its range at (x, y) needs no ray. Returns 0 where it
 * does: seen at a small angle that plane runs away. */
static int known_centre(const struct caster *c, const struct cast_setup *s, const struct origins *from, struct job *job,
                        double energy, double x, double y)
{
    uint32_t p = job->pulse;
    struct beam_return *r = &job->centre;
    if (isnan(c->range_m[p])) return 1; /* nothing there */
    if (c->beam->cosine[p] < 0.02 || c->hit[p] == CAST_NO_TRIANGLE) return 0;
    const struct bvh_triangle *tri = &s->bvh->triangle[c->hit[p]];
    const double dir[3] = {c->dx[p], c->dy[p], c->dz[p]};
    double origin[3], out[3];
    pulse_origin(from, p, origin);
    sub_ray(&s->beam->beam, dir, job, x, y, origin, out);
    for (int i = 0; i < 3; i++)
        origin[i] -= s->bvh->origin_m[i];
    r->range_m = (tri->d - vec3_dot(tri->n, origin)) / vec3_dot(tri->n, out);
    r->energy = energy;
    r->cosine = (float)c->beam->cosine[p];
    r->triangle = c->hit[p];
    r->label = c->label[p];
    return 1;
}

/* The rays that a pulse needs, given the outlines up to limit_m. Returns 0 where the central one will do. */
static int plan_job(struct caster *c, const struct cast_setup *s, const struct origins *from, struct job *job,
                    double limit_m)
{
    const struct cast_beam *b = s->beam;
    const double dir[3] = {c->dx[job->pulse], c->dy[job->pulse], c->dz[job->pulse]};
    struct beam_line line[BEAM_MAX_LINES];
    struct beam_parts parts;
    job->first = c->beam->pool.n;
    job->n = 0;
    job->centre.energy = 0.0;
    uint32_t lines = beam_find_lines(b->outlines, &b->beam, dir, limit_m, line, &job->next_m);
    if (lines == 0) return 0;
    beam_axes(dir, job->e1, job->e2);
    if (lines > BEAM_MAX_LINES || beam_cut(&b->beam, &b->fine, line, lines, &parts) != 0) {
        add_pattern(c, b, from, job);
        job->next_m = INFINITY;
        c->counters.ragged++;
        return 1;
    }
    for (uint32_t i = 0; i < parts.n; i++)
        if (i != parts.centre || !known_centre(c, s, from, job, parts.energy[i], parts.x[i], parts.y[i]))
            add_ray(c, &b->beam, from, job, parts.x[i], parts.y[i], parts.energy[i]);
    return 1;
}

/* Casts what is in the pool from ray `first` on. */
static void cast_pool(struct caster *c, const struct cast_setup *s, uint32_t first)
{
    struct pool *p = &c->beam->pool;
    c->counters.sub_rays += p->n - first;
    for (uint32_t at = first, n; at < p->n; at += n) {
        n = p->n - at < CHUNK ? p->n - at : CHUNK;
        const struct origins from = {.px = p->px + at, .py = p->py + at, .pz = p->pz + at};
        const struct caster_rays rays = {.dx = p->dx + at,
                                         .dy = p->dy + at,
                                         .dz = p->dz + at,
                                         .range_m = p->range_m + at,
                                         .cosine = p->cosine + at,
                                         .label = p->label + at,
                                         .triangle = p->triangle + at};
        caster_hits_from(c, s->bvh, &from, s->range_max_m, n, rays.dx, rays.dy, rays.dz, rays.range_m, rays.triangle);
        memcpy(rays.label, c->seen, n * sizeof *rays.label);
        kernel_incidence(s->bvh, rays.triangle, rays.dx, rays.dy, rays.dz, n, rays.cosine);
        caster_movers(c, s, &from, &rays, n);
    }
}

/* Outlines behind what the centre meets count too, where another part of the footprint looks past it. */
static void look_behind(struct caster *c, const struct cast_setup *s, const struct origins *from, uint32_t reserve)
{
    struct beam_work *w = c->beam;
    uint32_t first = w->pool.n;
    for (uint32_t j = 0; j < w->n_jobs; j++) {
        struct job *job = &w->job[j];
        double far_m = job->centre.energy > 0.0 ? job->centre.range_m : 0.0;
        if (!(job->next_m < INFINITY) || w->pool.n + reserve > POOL) continue;
        for (uint32_t i = job->first; i < job->first + job->n; i++)
            far_m = isnan(w->pool.range_m[i]) ? (double)INFINITY : fmax(far_m, w->pool.range_m[i]);
        double limit_m = far_m + 4.0 * beam_radius(&s->beam->beam, far_m);
        if (job->next_m < limit_m) plan_job(c, s, from, job, limit_m);
    }
    if (w->pool.n != first) cast_pool(c, s, first);
}

/* The returns of a job as echoes. */
static void finish_job(struct caster *c, const struct cast_setup *s, const struct job *job)
{
    struct beam_work *w = c->beam;
    const struct pool *p = &w->pool;
    uint32_t n = 0;
    if (job->centre.energy > 0.0) w->returns[n++] = job->centre;
    for (uint32_t i = job->first; i < job->first + job->n; i++) {
        if (isnan(p->range_m[i])) continue;
        w->returns[n++] = (struct beam_return){.range_m = p->range_m[i],
                                               .energy = p->energy[i],
                                               .cosine = (float)p->cosine[i],
                                               .triangle = p->triangle[i],
                                               .label = p->label[i]};
    }
    c->counters.left_out += beam_merge(&s->beam->beam, w->returns, n, job->pulse, s->beam->max_echoes, &w->some);
}

static void run_jobs(struct caster *c, const struct cast_setup *s, const struct origins *from, uint32_t reserve)
{
    struct beam_work *w = c->beam;
    cast_pool(c, s, 0);
    for (int pass = 0; pass < MAX_PASSES && s->beam->mode == BEAM_ADAPTIVE; pass++)
        look_behind(c, s, from, reserve);
    for (uint32_t j = 0; j < w->n_jobs; j++)
        finish_job(c, s, &w->job[j]);
    w->n_jobs = w->pool.n = 0;
}

/* Fills w->some with the echoes of pulses that one ray does not do for; gives those pulses in w->near. */
static uint32_t sub_rays(struct caster *c, const struct cast_setup *s, const struct origins *from, uint32_t n)
{
    struct beam_work *w = c->beam;
    const struct cast_beam *b = s->beam;
    int adaptive = b->mode == BEAM_ADAPTIVE;
    uint32_t reserve = !adaptive || b->pattern.n > BEAM_MAX_PARTS ? b->pattern.n : BEAM_MAX_PARTS, cut = 0;
    uint32_t candidates = n;
    if (adaptive) candidates = beam_near_outlines(b->outlines, c->dx, c->dy, c->dz, w->limit_m, n, w->near);
    w->n_jobs = w->pool.n = w->some.n = 0;
    for (uint32_t k = 0; k < candidates; k++) {
        struct job *job = &w->job[w->n_jobs];
        job->pulse = adaptive ? w->near[k] : k;
        job->next_m = INFINITY;
        if (!adaptive) {
            const double dir[3] = {c->dx[k], c->dy[k], c->dz[k]};
            job->first = w->pool.n;
            job->n = 0;
            job->centre.energy = 0.0;
            beam_axes(dir, job->e1, job->e2);
            add_pattern(c, b, from, job);
        } else if (!plan_job(c, s, from, job, w->limit_m[job->pulse])) {
            continue;
        }
        w->near[cut++] = job->pulse;
        w->n_jobs++;
        if (w->n_jobs == MAX_JOBS || w->pool.n + reserve > POOL) run_jobs(c, s, from, reserve);
    }
    run_jobs(c, s, from, reserve);
    if (adaptive) c->counters.outlined += cut;
    return cut;
}

/* One ray for all of a footprint on one plane. */
static void add_single(const struct caster *c, const struct cast_setup *s, uint32_t i, struct beam_echoes *e)
{
    if (isnan(c->range_m[i])) return;
    uint32_t at = e->n++;
    double cosine = c->beam->cosine[i];
    const struct beam *beam = &s->beam->beam;
    double sigma_m = 2.3548 * beam_plane_sigma(beam, c->range_m[i], cosine);
    e->pulse[at] = i;
    e->range_m[at] = c->range_m[i] + beam_plane_excess(beam, c->range_m[i], cosine);
    e->energy[at] = 1.0f;
    e->cosine[at] = (float)cosine;
    e->width_m[at] = (float)sqrt(beam->resolution_m * beam->resolution_m + sigma_m * sigma_m);
    e->triangle[at] = c->hit[i];
    e->label[at] = c->label[i];
}

static void copy_echo(struct beam_echoes *to, uint32_t at, const struct beam_echoes *from, uint32_t i)
{
    to->pulse[at] = from->pulse[i];
    to->range_m[at] = from->range_m[i];
    to->energy[at] = from->energy[i];
    to->cosine[at] = from->cosine[i];
    to->width_m[at] = from->width_m[i];
    to->triangle[at] = from->triangle[i];
    to->label[at] = from->label[i];
}

/* Pulses with sub-rays and the others, in order. */
static void gather_echoes(struct caster *c, const struct cast_setup *s, uint32_t n, uint32_t cut)
{
    struct beam_work *w = c->beam;
    uint32_t k = 0, i = 0;
    w->echoes.n = 0;
    for (uint32_t p = 0; p < n; p++) {
        if (k == cut || w->near[k] != p) {
            add_single(c, s, p, &w->echoes);
            continue;
        }
        k++;
        while (i < w->some.n && w->some.pulse[i] == p)
            copy_echo(&w->echoes, w->echoes.n++, &w->some, i++);
    }
}

/* ---- THE PLACE FOR DETECTION: amplitude, threshold and reflectance of the list's echoes go here; what is below the
 * threshold is dropped by leaving it out, as echoes out of the head's range are. */
static void detect_echoes(const struct cast_setup *s, struct beam_echoes *e)
{
    uint32_t kept = 0;
    for (uint32_t i = 0; i < e->n; i++)
        if (e->range_m[i] >= s->range_min_m && e->range_m[i] <= s->range_max_m) {
            if (kept != i) copy_echo(e, kept, e, i);
            kept++;
        }
    e->n = kept;
}

/* Which of a pulse's echoes [first, end) is asked for. */
static uint32_t choose(const struct beam_echoes *e, enum beam_select select, uint32_t first, uint32_t end)
{
    uint32_t best = first;
    if (select == BEAM_FIRST) return first;
    if (select == BEAM_LAST) return end - 1;
    for (uint32_t i = first; i < end; i++)
        if (e->energy[i] > e->energy[best]) best = i;
    return best;
}

/* Points of up to CHUNK entries: number byte, label, pulse; ranges in c. */
struct points {
    uint32_t n, pulse[CHUNK];
};

static void restore(struct caster *c, const struct cast_setup *s, const struct points *points)
{
    const struct beam_work *w = c->beam;
    for (uint32_t i = 0; i < points->n; i++) {
        c->mirror_turn[i] = w->mirror_turn[points->pulse[i]];
        c->pan_turn[i] = w->pan_turn[points->pulse[i]];
    }
    for (uint32_t i = 0; i < points->n && s->layout == LINE_GEO; i++) {
        c->ex[i] = w->ex[points->pulse[i]];
        c->ey[i] = w->ey[points->pulse[i]];
        c->ez[i] = w->ez[points->pulse[i]];
    }
    for (uint32_t i = 0; i < points->n && s->n_knots != 0; i++) {
        c->moving.px[i] = w->px[points->pulse[i]];
        c->moving.py[i] = w->py[points->pulse[i]];
        c->moving.pz[i] = w->pz[points->pulse[i]];
    }
}

static void keep(struct caster *c, const struct cast_setup *s, uint32_t n)
{
    struct beam_work *w = c->beam;
    const size_t bytes = n * sizeof(double);
    memcpy(w->mirror_turn, c->mirror_turn, bytes);
    memcpy(w->pan_turn, c->pan_turn, bytes);
    if (s->layout == LINE_GEO) {
        memcpy(w->ex, c->ex, bytes);
        memcpy(w->ey, c->ey, bytes);
        memcpy(w->ez, c->ez, bytes);
    }
    if (s->n_knots != 0) {
        memcpy(w->px, c->moving.px, bytes);
        memcpy(w->py, c->moving.py, bytes);
        memcpy(w->pz, c->moving.pz, bytes);
    }
}

/* What could not be said is no echo, and counted; the pulse's other echoes are numbered anew. Returns how many entries
 * are left of n. */
static uint32_t drop_unfit(struct caster *c, struct line_block *b, uint32_t at, uint32_t n, uint32_t *echoes)
{
    uint32_t to = at;
    for (uint32_t i = at, end; i < at + n; i = end) {
        uint32_t first = to, count = 0;
        for (end = i + 1; end < at + n && (b->echo[end] & 15) > 1;)
            end++;
        for (uint32_t k = i; k < end; k++) {
            int fits = b->a[k] != (uint32_t)LINE_XYZ_NONE && b->b[k] != (uint32_t)LINE_XYZ_NONE &&
                       b->c[k] != (uint32_t)LINE_XYZ_NONE;
            if (!fits && b->echo[k] != 0) c->counters.unfit++;
            if (!fits && (k + 1 < end || to > first)) continue; /* but one entry stays */
            b->a[to] = b->a[k];
            b->b[to] = b->b[k];
            b->c[to] = b->c[k];
            b->dt_ns[to] = b->dt_ns[k];
            b->refl_cdb[to] = b->refl_cdb[k];
            b->label[to] = fits ? b->label[k] : (uint16_t)LINE_LABEL_NONE;
            count += (uint32_t)fits;
            to++;
        }
        *echoes += count;
        for (uint32_t k = first; k < to; k++)
            b->echo[k] = (uint8_t)(count == 0 ? 0 : (k - first + 1) | count << 4);
        if (count == 0) b->a[first] = b->b[first] = b->c[first] = (uint32_t)LINE_XYZ_NONE;
    }
    return to - at;
}

struct writer {
    struct caster *c;
    const struct cast_setup *s;
    struct line_block *block;
    const uint32_t *dt_ns;
    uint64_t pulse0;
    int linear;
    uint32_t *at, echoes;
    struct points points;
};

static void flush(struct writer *w)
{
    struct points *p = &w->points;
    uint32_t at = *w->at, n = p->n, echoes = 0;
    if (n == 0) return;
    restore(w->c, w->s, p);
    for (uint32_t i = 0; i < n; i++) {
        w->block->refl_cdb[at + i] = LINE_REFL_NONE;
        echoes += w->block->echo[at + i] != 0;
    }
    if (caster_wire(w->c, w->s, w->linear, w->block, at, n) != 0) {
        echoes = 0;
        n = drop_unfit(w->c, w->block, at, n, &echoes);
    }
    w->echoes += echoes;
    *w->at += n;
    p->n = 0;
}

/* One entry; the noise is keyed by pulse and echo, the first echo's as that of a single ray. */
static void write_point(struct writer *w, uint32_t pulse, const struct beam_echoes *e, uint32_t i, uint8_t number)
{
    const struct cast_setup *s = w->s;
    uint32_t k = w->points.n++, at = *w->at + k;
    double range_m = number != 0 ? e->range_m[i] : (double)NAN;
    if (number != 0 && s->noise_on) {
        uint64_t counter = w->pulse0 + pulse + ((uint64_t)((number & 15) - 1) << 56);
        range_m += (s->range_sigma_m + 1e-6 * s->range_sigma_ppm * range_m) * rng_normal(s->noise_key, counter);
    }
    w->points.pulse[k] = pulse;
    w->c->range_m[k] = range_m;
    w->block->dt_ns[at] = w->dt_ns[pulse];
    w->block->echo[at] = number;
    w->block->label[at] = number != 0 ? (uint16_t)e->label[i] : (uint16_t)LINE_LABEL_NONE;
}

/* Echoes of the chunk, pulse by pulse. All of a pulse go into one piece. */
static void write_points(struct writer *w, const struct beam_echoes *e, uint32_t n)
{
    for (uint32_t p = 0, i = 0, end; p < n; p++, i = end) {
        for (end = i; end < e->n && e->pulse[end] == p;)
            end++;
        if (w->points.n + LINE_MAX_ECHOES > CHUNK) flush(w);
        uint32_t count = end - i;
        if (count == 0)
            write_point(w, p, e, i, 0);
        else if (count == 1 || w->s->echoes != BEAM_ALL)
            write_point(w, p, e, choose(e, w->s->echoes, i, end), 0x11);
        else
            for (uint32_t k = 0; k < count; k++)
                write_point(w, p, e, i + k, (uint8_t)((k + 1) | count << 4));
    }
    flush(w);
}

uint32_t beam_chunk(struct caster *c, const struct cast_setup *s, const struct origins *from, int linear,
                    uint64_t pulse0, const uint32_t *dt_ns, uint32_t n, struct line_block *block, uint32_t *at)
{
    struct beam_work *w = c->beam;
    struct writer writer = {
        .c = c, .s = s, .block = block, .dt_ns = dt_ns, .pulse0 = pulse0, .linear = linear, .at = at};
    const struct caster_rays rays = {.dx = c->dx,
                                     .dy = c->dy,
                                     .dz = c->dz,
                                     .range_m = c->range_m,
                                     .cosine = w->cosine,
                                     .label = c->label,
                                     .triangle = c->hit};
    kernel_incidence(s->bvh, c->hit, c->dx, c->dy, c->dz, n, w->cosine);
    caster_movers(c, s, from, &rays, n);
    kernel_limits(&s->beam->beam, c->range_m, w->cosine, n, w->limit_m);
    uint32_t cut = sub_rays(c, s, from, n);
    gather_echoes(c, s, n, cut);
    detect_echoes(s, &w->echoes);
    caster_ends(c, CAST_DETECT);
    keep(c, s, n);
    write_points(&writer, &w->echoes, n);
    caster_ends(c, CAST_POSITIONS);
    return writer.echoes;
}
