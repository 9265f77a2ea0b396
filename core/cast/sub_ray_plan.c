/* Which sub-rays a pulse gets, and where in its footprint. */
#include <math.h>

#include "core/cast/beam_work.h"
#include "core/vec3.h"
#include "core/vecmath.h"

/* The sub-ray at (x, y) of a pulse's disc. */
VEC_INLINE void sub_ray(const struct beam *beam, const double dir[restrict 3], const struct job *restrict job, double x,
                        double y, double origin[restrict 3], double out[restrict 3])
{
    for (int i = 0; i < 3; i++) {
        origin[i] += beam->exit_radius_m * (x * job->e1[i] + y * job->e2[i]);
        out[i] = dir[i] + beam->slope * (x * job->e2[i] - y * job->e1[i]);
    }
    /* 1 / sqrt(1 + t): without a root and a quotient to wait for; what is left out is below t^4, with t < 2.5e-5. */
    double t = beam->slope * beam->slope * (x * x + y * y);
    double over = 1.0 - t * (0.5 - t * (0.375 - 0.3125 * t));
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

void beam_plan_whole(struct caster *c, const struct cast_beam *b, const struct origins *from, struct job *job)
{
    const double dir[3] = {c->dx[job->pulse], c->dy[job->pulse], c->dz[job->pulse]};
    job->first = c->beam->pool.n;
    job->n = 0;
    job->centre.energy = 0.0;
    job->next_m = INFINITY;
    job->whole = 1;
    beam_axes(dir, job->e1, job->e2);
    for (uint32_t i = 0; i < b->pattern.n; i++)
        add_ray(c, &b->beam, from, job, (double)b->pattern.x[i], (double)b->pattern.y[i], 1.0 / b->pattern.n);
    for (uint32_t i = job->first; i < job->first + job->n && c->attributes; i++) {
        c->beam->pool.xx[i] = c->beam->pool.yy[i] = (float)b->pattern.rest;
        c->beam->pool.xy[i] = 0.0f;
    }
}

/* The part with the centre lies on the surface that is met there: its range at (x, y) needs no ray. Returns 0 where it
 * does: seen at a small angle that plane runs away. */
static int known_centre(const struct caster *c, const struct cast_setup *s, const struct origins *from, struct job *job,
                        const struct beam_parts *parts, const struct beam_spread *spread)
{
    const uint32_t p = job->pulse, part = parts->centre;
    struct beam_return *r = &job->centre;
    if (isnan(c->range_m[p])) return 1; /* nothing there */
    if (c->beam->steep[p] > 2500.0f) return 0;
    const struct bvh_triangle *tri = &s->bvh->triangle[c->hit[p]];
    const double dir[3] = {c->dx[p], c->dy[p], c->dz[p]};
    double origin[3], out[3];
    pulse_origin(from, p, origin);
    sub_ray(&s->beam->beam, dir, job, parts->x[part], parts->y[part], origin, out);
    for (int i = 0; i < 3; i++)
        origin[i] -= s->bvh->origin_m[i];
    r->range_m = (tri->d - vec3_dot(tri->n, origin)) / vec3_dot(tri->n, out);
    r->energy = parts->energy[part];
    r->sigma_m = 0.0f;
    if (c->attributes)
        r->sigma_m = beam_part_sigma(&s->beam->beam, dir, job, tri->n, r->range_m, spread->xx[part], spread->xy[part],
                                     spread->yy[part]);
    r->cosine = s->detect != NULL ? 1.0f / sqrtf(c->beam->steep[p]) : 0.0f;
    r->triangle = c->hit[p];
    r->label = c->label[p];
    return 1;
}

/* A ray for part i. */
static void add_part(const struct caster *c, const struct beam *beam, const struct origins *from, struct job *job,
                     const struct beam_parts *parts, const struct beam_spread *spread, uint32_t i)
{
    struct pool *pool = &c->beam->pool;
    uint32_t at = pool->n;
    add_ray(c, beam, from, job, parts->x[i], parts->y[i], parts->energy[i]);
    if (!c->attributes) return;
    pool->xx[at] = (float)spread->xx[i];
    pool->xy[at] = (float)spread->xy[i];
    pool->yy[at] = (float)spread->yy[i];
}

/* The centre is beyond doubt on its side of the lines: where the outlines' floats and the ray's hit might differ on it,
 * what the centre meets says nothing about its part. Floats from the station are good to 2^-24 of the range: less than
 * 1e-3 of the radius where that is 6e-5 of the range or more, as beams of 0.12 mrad and wider have it. */
static int is_centre_clear(const struct beam_line *line, uint32_t n)
{
    for (uint32_t i = 0; i < n; i++)
        if (line[i].h < 2e-3) return 0;
    return 1;
}

int beam_plan_job(struct caster *c, const struct cast_setup *s, const struct origins *from, struct job *job,
                  double limit_m, uint32_t known)
{
    const struct cast_beam *b = s->beam;
    const double dir[3] = {c->dx[job->pulse], c->dy[job->pulse], c->dz[job->pulse]};
    struct beam_line line[BEAM_MAX_LINES];
    struct beam_parts parts;
    struct beam_spread spread; /* filled only where attributes are asked for */
    beam_axes(dir, job->e1, job->e2);
    uint32_t lines =
        beam_find_lines(b->outlines, &b->beam, job->near, dir, job->e1, job->e2, limit_m, line, &job->next_m);
    if (lines == known) return 0;
    job->lines = lines;
    job->first = c->beam->pool.n;
    job->n = 0;
    job->centre.energy = 0.0;
    job->whole = 0;
    if (lines > BEAM_MAX_LINES || ++job->passes > MAX_PASSES ||
        beam_cut_spread(&b->beam, &b->fine, line, lines, &parts, c->attributes ? &spread : NULL) != 0) {
        beam_plan_whole(c, b, from, job);
        c->counters.ragged++;
        return 1;
    }
    const int clear = is_centre_clear(line, lines);
    for (uint32_t i = 0; i < parts.n; i++)
        if (i != parts.centre || !clear || !known_centre(c, s, from, job, &parts, &spread))
            add_part(c, &b->beam, from, job, &parts, &spread, i);
    return 1;
}
