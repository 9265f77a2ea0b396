/* SPDX-License-Identifier: MIT */
/* Follows rays through glass and off mirrors: only rays that hit such a surface are cast again, together. */
#include "core/cast/optics.h"

#include <math.h>

#include "core/cast/nearest.h"
#include "core/surface.h"
#include "core/vec3.h"

int caster_goes_on(const struct cast_setup *s, uint32_t label)
{
    const struct surface *surface = surface_at(s->detect->surfaces, label);
    return surface->glass > 0.0 || surface->mirror > 0.0;
}

int caster_is_bare(const struct cast_setup *s, uint32_t label, double rho)
{
    return rho == 0.0 && s->detect->depth > 0 && caster_goes_on(s, label);
}

void caster_normal(const struct cast_setup *s, uint8_t body, uint32_t hit, double n[3])
{
    const struct cast_mover *m = body != 0 ? caster_body(s, body) : NULL;
    struct bvh_plane at_rest;
    bvh_get_plane(m != NULL ? m->bvh : s->bvh, hit, &at_rest);
    double length = vec3_length(at_rest.n);
    for (int i = 0; i < 3; i++)
        n[i] = (m == NULL ? at_rest.n[i] : vec3_dot(m->rotation + 3 * i, at_rest.n)) / length;
}

/* A path goes on this far beyond a surface, measured across it, so that it does not hit the surface again. The error of
 * double precision is less than a tenth of it, up to 1e8 m from the scene's zero. */
static const double STEP_M = 1e-6;

/* Makes ray k go on from its hit, as ray `to` <= k. Only what set_out sets outlives the next cast. */
static void set_out(const struct cast_setup *s, struct path_rays *p, uint32_t to, uint32_t k)
{
    const struct surface *surface = surface_at(s->detect->surfaces, p->label[k]);
    double at[3] = VEC3_AT(p->p, k), dir[3] = VEC3_AT(p->d, k), n[3];
    for (int a = 0; a < 3; a++)
        at[a] += p->range_m[k] * dir[a];
    double step = STEP_M / fmax(p->cosine[k], 1e-3), share = surface->glass;
    uint8_t ghost = p->ghost[k];
    if (surface->mirror > 0.0) {
        caster_normal(s, p->body[k], p->hit[k], n);
        double along = 2.0 * vec3_dot(n, dir);
        for (int a = 0; a < 3; a++)
            dir[a] -= along * n[a];
        share = surface->mirror;
        ghost = 1;
    }
    p->ray[to] = p->ray[k];
    p->length_m[to] = p->length_m[k] + (p->range_m[k] + step);
    p->energy[to] = p->energy[k] * (share * share); /* back and forth */
    p->ghost[to] = ghost;
    for (int a = 0; a < 3; a++)
        at[a] += step * dir[a];
    VEC3_SET(p->p, to, at);
    VEC3_SET(p->d, to, dir);
}

/* Sends out the rays whose first hit lets them go on. */
static void optics_begin(const struct cast_setup *s, const struct ray_hits *hits, struct path_rays *p)
{
    const struct bvh_rays *rays = &hits->rays;
    p->n = p->n_found = 0;
    for (uint32_t i = 0; i < rays->n; i++) {
        double at[3];
        p->first[i] = CAST_NO_PATH;
        if (isnan(rays->range_m[i]) || !caster_goes_on(s, rays->label[i])) continue;
        uint32_t k = p->n++;
        p->ray[k] = i;
        bvh_origin_of(&rays->from, i, at);
        VEC3_SET(p->p, k, at);
        VEC3_SET(p->d, k, ((const double[3])VEC3_AT(rays->dir, i)));
        p->length_m[k] = 0.0;
        p->energy[k] = 1.0;
        p->ghost[k] = 0;
        p->range_m[k] = rays->range_m[i];
        p->cosine[k] = hits->cosine[i];
        p->label[k] = rays->label[i];
        p->hit[k] = rays->triangle[i];
        p->body[k] = hits->body[i];
        set_out(s, p, k, k);
    }
}

/* Puts the hit of ray k at the end of its first ray's chain. */
static void optics_keep(struct path_rays *p, uint32_t k)
{
    uint32_t at = p->n_found++, ray = p->ray[k];
    p->found[at] = (struct path_hit){.range_m = p->length_m[k] + p->range_m[k],
                                     .cosine = p->cosine[k],
                                     .energy = p->energy[k],
                                     .label = p->label[k],
                                     .next = CAST_NO_PATH,
                                     .triangle = p->hit[k],
                                     .colour = p->colour[k],
                                     .ghost = p->ghost[k],
                                     .body = p->body[k]};
    if (p->first[ray] == CAST_NO_PATH)
        p->first[ray] = at;
    else
        p->found[p->last[ray]].next = at;
    p->last[ray] = at;
}

void caster_follow(struct nearest *w, const struct cast_setup *s, const struct ray_hits *first, struct path_rays *p)
{
    optics_begin(s, first, p);
    for (uint32_t depth = 0; depth < s->detect->depth && p->n > 0; depth++) {
        uint32_t on = 0;
        const struct ray_hits hits = {.rays = {.n = p->n,
                                               .from.own = VEC3_IN(p->p, 0),
                                               .dir = VEC3_IN(p->d, 0),
                                               .range_max_m = s->range_max_m,
                                               .scattered = first->rays.scattered,
                                               .range_m = p->range_m,
                                               .triangle = p->hit,
                                               .label = p->label},
                                      .cosine = p->cosine,
                                      .body = p->body,
                                      .colour = first->colour != NULL ? p->colour : NULL};
        caster_nearest(w, s, &hits);
        for (uint32_t k = 0; k < p->n; k++) {
            if (!(p->length_m[k] + p->range_m[k] <= s->range_max_m)) continue;
            optics_keep(p, k);
            if (depth + 1 < s->detect->depth && caster_goes_on(s, p->label[k])) set_out(s, p, on++, k);
        }
        p->n = on;
    }
}
