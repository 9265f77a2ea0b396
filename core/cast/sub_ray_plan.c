/* SPDX-License-Identifier: MIT */
/* Which sub-rays a pulse gets, and where in its footprint. */
#include "core/cast/sub_rays.h"

#include <math.h>
#include <string.h>

#include "core/cast/caster.h"
#include "core/cast/chunk.h"
#include "core/vecmath.h"

/* The sub-ray at (x, y) of a pulse's disc. origin: of the pulse, becomes that of the sub-ray. */
VEC_INLINE void sub_ray(const struct beam *beam, const struct beam_sight *restrict sight, const struct beam_part *part,
                        double origin[restrict 3], double out[restrict 3])
{
    const double x = part->x, y = part->y;
    for (int i = 0; i < 3; i++) {
        origin[i] += beam->exit_radius_m * (x * sight->e1[i] + y * sight->e2[i]);
        out[i] = sight->dir[i] + beam->slope * (x * sight->e2[i] - y * sight->e1[i]);
    }
    /* 1 / sqrt(1 + t) as a series, which is faster than root and division. Its error is below t^4, with t
     * < 2.5e-5. */
    double t = beam->slope * beam->slope * (x * x + y * y);
    double over = 1.0 - t * (0.5 - t * (0.375 - 0.3125 * t));
    for (int i = 0; i < 3; i++)
        out[i] *= over;
}

/* A ray for a part. */
static void add_ray(struct caster *c, const struct chunk *k, struct job *job, const struct beam_part *part)
{
    struct pool *pool = &c->sub_rays->pool;
    uint32_t i = pool->n++;
    double origin[3], out[3];
    bvh_origin_of(&k->from, job->pulse, origin);
    sub_ray(&k->s->beam->beam, &job->sight, part, origin, out);
    VEC3_SET(pool->p, i, origin);
    VEC3_SET(pool->d, i, out);
    pool->energy[i] = part->energy;
    job->n++;
    if (!k->spreads) return;
    pool->xx[i] = (float)part->xx;
    pool->xy[i] = (float)part->xy;
    pool->yy[i] = (float)part->yy;
}

static void look_along(const struct caster *c, struct job *job)
{
    const double dir[3] = VEC3_AT(c->d, job->pulse);
    memcpy(job->sight.dir, dir, sizeof dir);
    beam_axes(dir, job->sight.e1, job->sight.e2);
}

void plan_whole(struct caster *c, const struct chunk *k, struct job *job)
{
    const struct beam_pattern *pattern = &k->s->beam->pattern;
    struct beam_part part = {.energy = 1.0 / pattern->n, .xx = pattern->rest, .yy = pattern->rest};
    job->first = c->sub_rays->pool.n;
    job->n = 0;
    job->centre.energy = 0.0;
    job->next_m = INFINITY;
    job->whole = 1;
    look_along(c, job);
    for (uint32_t i = 0; i < pattern->n; i++) {
        part.x = (double)pattern->x[i];
        part.y = (double)pattern->y[i];
        add_ray(c, k, job, &part);
    }
}

/* The part with the centre lies on the surface that the centre hits: its range at (x, y) needs no ray.
 * Returns 0 where it does need one: at a small angle the plane's range is useless. */
static int known_centre(const struct caster *c, const struct chunk *k, struct job *job, const struct beam_part *part)
{
    const uint32_t p = job->pulse;
    const float steep = c->sub_rays->steep[p];
    const struct bvh *bvh = k->s->bvh;
    struct beam_return *r = &job->centre;
    if (isnan(c->list.range_m[p])) return 1; /* nothing there */
    if (steep > 2500.0f) return 0;
    const struct bvh_plane *tri = bvh_plane(bvh, c->hit[p]);
    double origin[3], local[3], out[3];
    bvh_origin_of(&k->from, p, origin);
    sub_ray(&k->s->beam->beam, &job->sight, part, origin, out);
    bvh_origin(bvh, local);
    vec3_sub(origin, local, origin);
    r->range_m = (tri->d - vec3_dot(tri->n, origin)) / vec3_dot(tri->n, out);
    r->energy = part->energy;
    r->sigma_m = k->spreads ? beam_part_sigma(&k->s->beam->beam, &job->sight, tri->n, r->range_m, part) : 0.0f;
    r->label = c->list.label[p];
    if (k->texels) r->colour = c->list.colour[p];
    return 1;
}

/* Whether the centre is certainly on its side of the lines. Where the outlines' floats and the ray's hit
 * might disagree, the centre's hit says nothing about its part. Floats from the station have an error of
 * 2^-24 of the range: less than
 * 1e-3 of the radius where that is 6e-5 of the range or more, as beams of 0.12 mrad and wider have it. */
static int is_centre_clear(const struct beam_line *line, uint32_t n)
{
    for (uint32_t i = 0; i < n; i++)
        if (line[i].h < 2e-3) return 0;
    return 1;
}

int plan_parts(struct caster *c, const struct chunk *k, struct job *job, double limit_m, uint32_t known)
{
    const struct cast_beam *b = k->s->beam;
    struct beam_line line[BEAM_MAX_LINES];
    struct beam_parts parts;
    look_along(c, job);
    uint32_t lines = beam_find_lines(b->outlines, &b->beam, job->near, &job->sight, limit_m, line);
    job->next_m = job->near->next_m;
    if (lines == known) return 0;
    job->lines = lines;
    job->first = c->sub_rays->pool.n;
    job->n = 0;
    job->centre.energy = 0.0;
    job->whole = 0;
    if (lines > BEAM_MAX_LINES || ++job->passes > MAX_PASSES ||
        beam_cut(&b->beam, &b->fine, line, lines, k->spreads, &parts) != 0) {
        plan_whole(c, k, job);
        c->counters.ragged++;
        return 1;
    }
    const int clear = is_centre_clear(line, lines);
    for (uint32_t i = 0; i < parts.n; i++)
        if (i != parts.centre || !clear || !known_centre(c, k, job, &parts.part[i])) add_ray(c, k, job, &parts.part[i]);
    return 1;
}
