/* Behind glass and off mirrors: only rays that meet such a surface are cast again, together.
 *
 * Packets of such rays hang on the packets of those that they go on from, and so on the pulse number: each
 * SCHEDULE_PACKET rays have packets of their own, filled up with copies of their last ray, whose number is
 * CAST_NO_PATH. */
#include <math.h>
#include <string.h>

#include "core/cast/caster_private.h"
#include "core/surface.h"
#include "core/vec3.h"

static const struct surface *surface_of(const struct cast_setup *s, uint32_t label)
{
    const struct surface_table *t = s->detect->surfaces;
    label = surface_of_label(label);
    return &t->surface[label < t->n ? label : t->n];
}

int caster_goes_on(const struct cast_setup *s, uint32_t label)
{
    const struct surface *surface = surface_of(s, label);
    return surface->glass > 0.0 || surface->mirror > 0.0;
}

/* Unit normal of a triangle, prcs. */
static void normal_of(const struct cast_setup *s, uint8_t body, uint32_t hit, double n[3])
{
    const struct cast_mover *m = body != 0 ? &s->mover[body - 1] : NULL;
    const double *at_rest = (m != NULL ? m->bvh : s->bvh)->triangle[hit].n;
    double length = sqrt(vec3_dot(at_rest, at_rest));
    for (int i = 0; i < 3; i++)
        n[i] = (m == NULL ? at_rest[i] : vec3_dot(m->rotation + 3 * i, at_rest)) / length;
}

/* How far behind a surface a way goes on: a float's rounding of where that is (in the BVH's frame), across the surface,
 * three times over; the surface itself is then not met again. */
static double step_m(const struct cast_setup *s, const double at[3], double cosine)
{
    double most = 0.0;
    for (int i = 0; i < 3; i++)
        most = fmax(most, fabs(at[i] - s->bvh->origin_m[i]));
    return fmax(1e-6, 3.0 * 0x1p-23 * most) / fmax(cosine, 1e-3);
}

/* Ray k sets out from what it has met. */
static void set_out(const struct cast_setup *s, struct path_rays *p, uint32_t k)
{
    const struct surface *surface = surface_of(s, p->label[k]);
    double at[3], dir[3] = {p->dx[k], p->dy[k], p->dz[k]}, n[3];
    at[0] = p->px[k] + p->range_m[k] * dir[0];
    at[1] = p->py[k] + p->range_m[k] * dir[1];
    at[2] = p->pz[k] + p->range_m[k] * dir[2];
    double step = step_m(s, at, p->cosine[k]), share = surface->glass;
    uint8_t ghost = p->ghost[k];
    if (surface->mirror > 0.0) {
        normal_of(s, p->body[k], p->hit[k], n);
        double along = 2.0 * vec3_dot(n, dir);
        for (int a = 0; a < 3; a++)
            dir[a] -= along * n[a];
        share = surface->mirror;
        ghost = 1;
    }
    p->length_m[k] += p->range_m[k] + step;
    p->energy[k] *= share * share; /* there and back */
    p->ghost[k] = ghost;
    p->px[k] = at[0] + step * dir[0];
    p->py[k] = at[1] + step * dir[1];
    p->pz[k] = at[2] + step * dir[2];
    p->dx[k] = dir[0];
    p->dy[k] = dir[1];
    p->dz[k] = dir[2];
}

static void copy_ray(struct path_rays *p, uint32_t to, uint32_t from)
{
    p->ray[to] = p->ray[from];
    p->px[to] = p->px[from];
    p->py[to] = p->py[from];
    p->pz[to] = p->pz[from];
    p->dx[to] = p->dx[from];
    p->dy[to] = p->dy[from];
    p->dz[to] = p->dz[from];
    p->length_m[to] = p->length_m[from];
    p->energy[to] = p->energy[from];
    p->ghost[to] = p->ghost[from];
    p->range_m[to] = p->range_m[from];
    p->cosine[to] = p->cosine[from];
    p->label[to] = p->label[from];
    p->hit[to] = p->hit[from];
    p->body[to] = p->body[from];
}

/* Fills the last packet up. */
static uint32_t fill_up(struct path_rays *p, uint32_t n)
{
    uint32_t end = (n + SCHEDULE_PACKET - 1) / SCHEDULE_PACKET * SCHEDULE_PACKET;
    for (uint32_t k = n; k < end; k++) {
        copy_ray(p, k, n - 1);
        p->ray[k] = CAST_NO_PATH;
    }
    return end;
}

/* The rays whose first hit lets them go on. */
static void begin(const struct cast_setup *s, const struct origins *from, const struct ray_set *set, uint32_t n,
                  struct path_rays *p)
{
    p->n = p->n_found = 0;
    for (uint32_t i = 0; i < n; i++) {
        if (i % SCHEDULE_PACKET == 0) p->n = fill_up(p, p->n);
        p->first[i] = CAST_NO_PATH;
        if (isnan(set->range_m[i]) || !caster_goes_on(s, set->label[i])) continue;
        uint32_t k = p->n++;
        p->ray[k] = i;
        p->px[k] = from->px != NULL ? from->px[i] : from->at_m[0];
        p->py[k] = from->px != NULL ? from->py[i] : from->at_m[1];
        p->pz[k] = from->px != NULL ? from->pz[i] : from->at_m[2];
        p->dx[k] = set->dx[i];
        p->dy[k] = set->dy[i];
        p->dz[k] = set->dz[i];
        p->length_m[k] = 0.0;
        p->energy[k] = 1.0;
        p->ghost[k] = 0;
        p->range_m[k] = set->range_m[i];
        p->cosine[k] = set->cosine[i];
        p->label[k] = set->label[i];
        p->hit[k] = set->hit[i];
        p->body[k] = set->body[i];
    }
    p->n = fill_up(p, p->n);
}

/* What ray k met, at the end of the first ray's chain. */
static void keep(struct path_rays *p, uint32_t k)
{
    uint32_t at = p->n_found++, ray = p->ray[k];
    p->next[at] = CAST_NO_PATH;
    p->found_m[at] = p->length_m[k] + p->range_m[k];
    p->found_cosine[at] = p->cosine[k];
    p->found_energy[at] = p->energy[k];
    p->found_label[at] = p->label[k];
    p->found_ghost[at] = p->ghost[k];
    if (p->first[ray] == CAST_NO_PATH)
        p->first[ray] = at;
    else
        p->next[p->last[ray]] = at;
    p->last[ray] = at;
}

void caster_follow_rays(struct caster *c, const struct cast_setup *s, const struct origins *first,
                        const struct ray_set *met, uint32_t n)
{
    struct path_rays *p = &c->paths;
    begin(s, first, met, n, p);
    for (uint32_t depth = 0; depth < s->detect->depth && p->n > 0; depth++) {
        uint32_t on = 0;
        for (uint32_t k = 0; k < p->n; k++)
            set_out(s, p, k);
        const struct origins from = {.px = p->px, .py = p->py, .pz = p->pz};
        const struct ray_set set = {.dx = p->dx,
                                    .dy = p->dy,
                                    .dz = p->dz,
                                    .range_m = p->range_m,
                                    .label = p->label,
                                    .hit = p->hit,
                                    .cosine = p->cosine,
                                    .body = p->body};
        caster_nearest(c, s, &from, &set, p->n);
        for (uint32_t k = 0; k < p->n; k++) {
            if (k % SCHEDULE_PACKET == 0) on = fill_up(p, on);
            if (p->ray[k] == CAST_NO_PATH || isnan(p->range_m[k])) continue;
            keep(p, k);
            if (caster_goes_on(s, p->label[k])) copy_ray(p, on++, k);
        }
        on = fill_up(p, on);
        p->n = on;
    }
}

static void append(struct echo_list *l, uint32_t pulse, double range_m, double cosine, double energy, uint32_t label,
                   uint8_t ghost)
{
    uint32_t at = l->n++;
    l->number[at] = at > 0 && l->pulse[at - 1] == pulse ? (uint8_t)(l->number[at - 1] + 1) : 0;
    l->pulse[at] = pulse;
    l->range_m[at] = range_m;
    l->cosine[at] = cosine;
    l->energy[at] = energy;
    l->label[at] = label;
    l->ghost[at] = ghost;
}

void caster_list_paths(struct caster *c, const struct ray_set *met, uint32_t n)
{
    const struct path_rays *p = &c->paths;
    struct echo_list *l = &c->list;
    l->n = 0;
    for (uint32_t i = 0; i < n; i++) {
        append(l, i, met->range_m[i], met->cosine[i], 1.0, met->label[i], 0);
        for (uint32_t k = p->first[i]; k != CAST_NO_PATH; k = p->next[k])
            append(l, i, p->found_m[k], p->found_cosine[k], p->found_energy[k], p->found_label[k], p->found_ghost[k]);
    }
}
