/* Pulses with a footprint: central hits, and where they are not all, sub-rays -> echoes. */
#include "core/cast/beam_private.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/vec3.h"

enum { MAX_PASSES = 4 };

int beam_work_create(struct beam_work **out, struct sh_err *err)
{
    struct beam_work *w = *out = aligned_alloc(64, (sizeof *w + 63) / 64 * 64); /* not touched until there is a beam */
    if (w == NULL) return sh_fail(err, SH_ENOMEM, "cast: no memory for a caster");
    memset(&w->some, 0, sizeof w->some);
    int rc = beam_echoes_alloc(&w->some, CHUNK * (LINE_MAX_ECHOES + 1), err);
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
    double over = 1.0 / sqrt(length2);
    for (int i = 0; i < 3; i++)
        out[i] *= over;
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
        add_ray(c, &b->beam, from, job, (double)b->pattern.x[i], (double)b->pattern.y[i], 1.0 / b->pattern.n);
}

/* The part with the centre lies on the surface that is met there: its range at (x, y) needs no ray. Returns 0 where it
 * does: seen at a small angle that plane runs away. */
static int known_centre(const struct caster *c, const struct cast_setup *s, const struct origins *from, struct job *job,
                        double energy, double x, double y)
{
    uint32_t p = job->pulse;
    struct beam_return *r = &job->centre;
    if (isnan(c->range_m[p])) return 1; /* nothing there */
    if (c->beam->steep[p] > 2500.0f) return 0;
    const struct bvh_triangle *tri = &s->bvh->triangle[c->hit[p]];
    const double dir[3] = {c->dx[p], c->dy[p], c->dz[p]};
    double origin[3], out[3];
    pulse_origin(from, p, origin);
    sub_ray(&s->beam->beam, dir, job, x, y, origin, out);
    for (int i = 0; i < 3; i++)
        origin[i] -= s->bvh->origin_m[i];
    r->range_m = (tri->d - vec3_dot(tri->n, origin)) / vec3_dot(tri->n, out);
    r->energy = energy;
    r->cosine = 1.0f / sqrtf(c->beam->steep[p]);
    r->triangle = c->hit[p];
    r->label = c->label[p];
    return 1;
}

/* The rays that a pulse needs, given the outlines up to limit_m. Returns 0 where those of `known` outlines will do, or
 * (0) the central one. */
static int plan_job(struct caster *c, const struct cast_setup *s, const struct origins *from, struct job *job,
                    double limit_m, uint32_t known)
{
    const struct cast_beam *b = s->beam;
    const double dir[3] = {c->dx[job->pulse], c->dy[job->pulse], c->dz[job->pulse]};
    struct beam_line line[BEAM_MAX_LINES];
    struct beam_parts parts;
    uint32_t lines = beam_find_lines(b->outlines, &b->beam, c->beam->cell[job->pulse], dir, limit_m, line, &job->next_m);
    if (lines == known) return 0;
    job->lines = lines;
    job->first = c->beam->pool.n;
    job->n = 0;
    job->centre.energy = 0.0;
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
    c->scattered = 0;
    for (uint32_t at = first, n; at < p->n; at += n) {
        n = p->n - at < CHUNK ? p->n - at : CHUNK;
        const struct origins from = {.px = p->px + at, .py = p->py + at, .pz = p->pz + at};
        const struct ray_set set = {.dx = p->dx + at,
                                    .dy = p->dy + at,
                                    .dz = p->dz + at,
                                    .range_m = p->range_m + at,
                                    .label = p->label + at,
                                    .hit = p->triangle + at,
                                    .cosine = p->cosine + at,
                                    .body = p->body + at};
        caster_nearest(c, s, &from, &set, n);
        for (uint32_t i = at; i < at + n && s->n_movers != 0; i++)
            if (p->body[i] != 0) p->triangle[i] = CAST_NO_TRIANGLE; /* not of the scene */
    }
    c->scattered = 0;
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
        if (job->next_m < limit_m) plan_job(c, s, from, job, limit_m, job->lines);
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
    if (adaptive) {
        candidates = beam_near_outlines(b->outlines, c->fx, c->fy, c->fz, n, w->cell, w->near);
    }
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
        } else if (!plan_job(c, s, from, job, kernel_limit(&b->beam, c->range_m[job->pulse], w->steep[job->pulse]), 0)) {
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

uint32_t beam_chunk(struct caster *c, const struct cast_setup *s, const struct origins *from, int linear,
                    uint64_t pulse0, const uint32_t *dt_ns, uint32_t n, struct line_block *block, uint32_t *at)
{
    uint32_t cut = sub_rays(c, s, from, n);
    if (s->beam->mode == BEAM_ADAPTIVE) kernel_excess(&s->beam->beam, c->beam->steep, n, c->range_m);
    uint32_t echoes = beam_write_points(c, s, linear, pulse0, dt_ns, n, cut, block, at);
    caster_ends(c, CAST_POSITIONS);
    return echoes;
}

float *beam_steep(struct caster *c)
{
    return c->beam->steep;
}
