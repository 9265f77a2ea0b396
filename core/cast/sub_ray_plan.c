/* SPDX-License-Identifier: MIT */
/* Chooses the sub-rays that a pulse gets, and where in its footprint they lie. */
#include "core/cast/sub_rays.h"

#include <math.h>
#include <string.h>

#include "core/vecmath.h"

enum { LANES = 8 }; /* the pool has room for that many beyond the last sub-ray */

/* A sub-ray: where it begins, and its unit direction. */
struct sub_ray {
    double from_m[3], dir[3];
};

/* Returns the sub-ray at (x, y) of the disc of a pulse that begins at from_m. */
VEC_INLINE struct sub_ray sub_ray(const struct beam *beam, const struct beam_sight *sight, const double from_m[3],
                                  double x, double y)
{
    const double exit_m = beam->exit_radius_m, slope = beam->slope;
    const double *dir = sight->dir, *e1 = sight->e1, *e2 = sight->e2;
    /* 1 / sqrt(1 + t) as a series, which is faster than root and division. The error of the series is below t^4 / 3,
     * where t is at most 1e-4: a divergence of 0.02 rad. This error is less than rounding. */
    const double t = slope * slope * (x * x + y * y), over = 1.0 - t * (0.5 - t * (0.375 - 0.3125 * t));
    return (struct sub_ray){{from_m[0] + exit_m * (x * e1[0] + y * e2[0]), from_m[1] + exit_m * (x * e1[1] + y * e2[1]),
                             from_m[2] + exit_m * (x * e1[2] + y * e2[2])},
                            {(dir[0] + slope * (x * e2[0] - y * e1[0])) * over,
                             (dir[1] + slope * (x * e2[1] - y * e1[1])) * over,
                             (dir[2] + slope * (x * e2[2] - y * e1[2])) * over}};
}

/* Adds a ray for a part of the footprint. */
static void add_ray(struct caster *c, const struct chunk *k, struct job *job, const struct beam_part *part)
{
    struct pool *pool = &c->sub_rays->pool;
    uint32_t i = pool->n++;
    double from_m[3];
    bvh_origin_of(&k->from, job->pulse, from_m);
    const struct sub_ray ray = sub_ray(&k->s->beam->beam, &job->sight, from_m, part->x, part->y);
    VEC3_SET(pool->p, i, ray.from_m);
    VEC3_SET(pool->d, i, ray.dir);
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

/* Adds the rays of a pattern in whole vectors, so it may write up to LANES - 1 more after them. */
VEC_CLONES
static void add_pattern(const struct beam *beam, const struct beam_sight *sight, const double from_m[3],
                        const struct beam_pattern *pattern, const struct vec3_out *to_p, const struct vec3_out *to_d)
{
    const struct beam_sight s = *sight;
    const struct vec3_out p = *to_p, d = *to_d;
    const double at_m[3] = {from_m[0], from_m[1], from_m[2]};
    const uint32_t n = (pattern->n + LANES - 1) / LANES * LANES;
    VEC_LOOP
    for (uint32_t i = 0; i < n; i++) {
        const struct sub_ray ray = sub_ray(beam, &s, at_m, (double)pattern->x[i], (double)pattern->y[i]);
        VEC3_SET(p, i, ray.from_m);
        VEC3_SET(d, i, ray.dir);
    }
}

void plan_whole(struct caster *c, const struct chunk *k, struct job *job)
{
    const struct beam_pattern *pattern = &k->s->beam->pattern;
    struct pool *pool = &c->sub_rays->pool;
    const uint32_t first = pool->n, end = first + pattern->n;
    const double energy = 1.0 / pattern->n;
    double from_m[3];
    job->first = first;
    job->n = pattern->n;
    job->centre.energy = 0.0;
    job->next_m = INFINITY;
    job->whole = 1;
    look_along(c, job);
    bvh_origin_of(&k->from, job->pulse, from_m);
    add_pattern(&k->s->beam->beam, &job->sight, from_m, pattern, &VEC3_OUT(pool->p, first), &VEC3_OUT(pool->d, first));
    for (uint32_t i = first; i < end; i++)
        pool->energy[i] = energy;
    pool->n = end;
    if (!k->spreads) return;
    for (uint32_t i = first; i < end; i++) {
        pool->xx[i] = pool->yy[i] = (float)pattern->rest;
        pool->xy[i] = 0.0f;
    }
}

/* The part with the centre lies on the surface that the centre hits: its range at (x, y) needs no ray.
 * Returns 0 where it does need one: beyond 88.9 degrees of incidence (1 / cos^2 of 2500) that range is useless. */
static int known_centre(const struct caster *c, const struct chunk *k, struct job *job, const struct beam_part *part)
{
    const uint32_t p = job->pulse;
    const float steep = c->sub_rays->steep[p];
    const struct bvh *bvh = k->s->bvh;
    struct beam_return *r = &job->centre;
    if (isnan(c->list.range_m[p])) return 1; /* nothing there */
    if (steep > 2500.0f) return 0;
    const struct bvh_plane *tri = bvh_plane(bvh, c->hit[p]);
    double from_m[3];
    bvh_origin_of(&k->from, p, from_m);
    const struct sub_ray ray = sub_ray(&k->s->beam->beam, &job->sight, from_m, part->x, part->y);
    vec3_sub(ray.from_m, bvh_origin(bvh), from_m);
    r->range_m = (tri->d - vec3_dot(tri->n, from_m)) / vec3_dot(tri->n, ray.dir);
    r->plane_m = c->list.range_m[p];
    r->energy = part->energy;
    r->sigma_m = k->spreads ? beam_part_sigma(&k->s->beam->beam, &job->sight, tri->n, r->range_m, part) : 0.0f;
    r->label = c->list.label[p];
    if (k->texels) r->colour = c->list.colour[p];
    return 1;
}

/* Returns whether all lines are so far from the centre that the centre's side of each line is certain. Ends of outlines
 * are floats relative to the station, so a line very near to the centre may pass on the centre's other side.
 * Then the centre's hit says nothing about the part around the centre. The floats have an error of 2^-24 of the range.
 * This error is 1e-3 of the footprint's radius for a divergence of 0.12 mrad, and less for wider beams. The limit is
 * twice this error. */
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
