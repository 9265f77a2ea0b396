/* SPDX-License-Identifier: MIT */
/* First hits of a chunk's rays: on the scene that stands still, on the bodies that move in it, on the tripod's
 * legs. */
#include "core/cast/nearest.h"

#include <math.h>
#include <string.h>

#include "core/cast/kernels_moving.h"
#include "core/cast/texels.h"
#include "core/mat3.h"

/* Returns the largest distance of an origin from the first one. */
static double spread_m(const struct vec3_in *p, uint32_t n)
{
    double most2 = 0.0;
    for (uint32_t i = 1; i < n; i++) {
        double x = p->x[i] - p->x[0], y = p->y[i] - p->y[0], z = p->z[i] - p->z[0];
        most2 = fmax(most2, x * x + y * y + z * z);
    }
    return sqrt(most2);
}

/* Where the body's hit is nearer, it replaces the scene's. */
static void keep_nearer(struct nearest *w, const struct cast_mover *m, uint8_t body, const struct ray_hits *hits)
{
    const struct bvh_rays *rays = &hits->rays;
    for (uint32_t i = 0; i < rays->n; i++) {
        const double range_m = w->mover_range_m[i];
        if (!(range_m < rays->range_m[i]) && !(isnan(rays->range_m[i]) && !isnan(range_m))) continue;
        rays->range_m[i] = range_m;
        rays->label[i] = w->mover_label[i];
        rays->triangle[i] = w->mover_hit[i];
        if (hits->body == NULL) continue;
        hits->body[i] = body;
        bvh_cosines(m->bvh, w->mover_hit + i, &VEC3_IN(w->mover_d, i), 1, hits->cosine + i);
    }
}

/* Casts into a body that is not in the scene's BVH, in the body's own frame: its nearer hits replace the others. */
static void cast_body(struct nearest *w, const struct cast_setup *s, uint8_t body, const struct ray_hits *hits)
{
    const struct cast_mover *m = caster_body(s, body);
    const struct bvh_origins *from = &hits->rays.from;
    const int own = from->own.x != NULL;
    const double back_m[3] = {-m->shift_m[0], -m->shift_m[1], -m->shift_m[2]};
    const uint32_t n = hits->rays.n;
    struct bvh_rays rays = hits->rays;
    double at[3], v[3], from_body[3];
    bvh_origin_of(from, 0, at);
    mat3_apply(m->rotation, m->centre_m, v);
    vec3_add(v, m->shift_m, v);
    vec3_sub(v, at, v);
    vec3_sub(at, m->shift_m, from_body);
    double radius_m = m->radius_m + (own ? spread_m(&from->own, n) : 0.0);
    if (!kernel_meets_sphere(&hits->rays.dir, n, v, radius_m)) return;
    mat3_apply_transposed(m->rotation, from_body, rays.from.at_m);
    if (own) {
        kernel_shift(&from->own, back_m, n, &VEC3_OUT(w->mover_p, 0));
        kernel_turn_back(&VEC3_IN(w->mover_p, 0), m->rotation, n, &VEC3_OUT(w->mover_p, 0));
        rays.from.own = VEC3_IN(w->mover_p, 0);
    }
    kernel_turn_back(&hits->rays.dir, m->rotation, n, &VEC3_OUT(w->mover_d, 0));
    rays.dir = VEC3_IN(w->mover_d, 0);
    rays.range_m = w->mover_range_m;
    rays.triangle = w->mover_hit;
    rays.label = w->mover_label;
    bvh_hits(w->bvh, m->bvh, &rays);
    keep_nearer(w, m, body, hits);
}

static int is_from_station(const struct cast_setup *s, const struct bvh_origins *from)
{
    return from->own.x == NULL && memcmp(from->at_m, s->station_m, sizeof from->at_m) == 0;
}

static void find_first(struct nearest *w, const struct cast_setup *s, const struct bvh_rays *rays)
{
    if (s->sight != NULL && is_from_station(s, &rays->from))
        sight_hits(w->sight, w->bvh, s->sight, rays);
    else
        bvh_hits(w->bvh, s->bvh, rays);
}

void caster_nearest(struct nearest *w, const struct cast_setup *s, const struct ray_hits *hits)
{
    const struct bvh_rays *rays = &hits->rays;
    if (!hits->known) find_first(w, s, rays);
    if (hits->body != NULL) {
        bvh_cosines(s->bvh, rays->triangle, &rays->dir, rays->n, hits->cosine);
        memset(hits->body, 0, rays->n * sizeof *hits->body);
    }
    for (uint32_t i = 0; i < s->n_movers; i++)
        cast_body(w, s, (uint8_t)(i + 1), hits);
    if (s->tripod != NULL && s->tripod->has_legs) cast_body(w, s, CAST_LEGS, hits);
    caster_texels(s, hits);
}
