/* SPDX-License-Identifier: MIT */
/* Pulses with a footprint: echoes from central hits, and from sub-rays where one hit is not enough. */
#include "core/cast/sub_rays.h"

#include <math.h>

#include "core/cast/kernels_points.h"
#include "core/cast/waves.h"
#include "core/surface.h"
#include "core/vec3.h"

/* Finds how much comes back from the surfaces that rays from `first` on have hit. */
static void weigh_pool(struct caster *c, const struct cast_setup *s, uint32_t first)
{
    struct pool *p = &c->sub_rays->pool;
    struct beyond *b = &c->sub_rays->beyond;
    if (s->detect == NULL || s->detect->surfaces == NULL) return;
    surface_return(s->detect->surfaces, p->n - first, p->label + first, p->cosine + first, p->rho + first);
    if (s->detect->depth > 0) surface_return(s->detect->surfaces, b->n, b->label, b->cosine, b->rho);
}

/* Follows rays of the pool from `at` on beyond their first hits. */
static void look_through(struct caster *c, const struct cast_setup *s, const struct ray_hits *hits, uint32_t at)
{
    const struct path_rays *p = &c->paths;
    struct beyond *b = &c->sub_rays->beyond;
    caster_follow(&c->nearest, s, hits, &c->paths);
    for (uint32_t i = 0; i < hits->rays.n; i++) {
        b->first[at + i] = b->n;
        for (uint32_t k = p->first[i]; k != CAST_NO_PATH; k = p->found[k].next) {
            uint32_t to = b->n++;
            b->range_m[to] = p->found[k].range_m;
            b->cosine[to] = p->found[k].cosine;
            b->share[to] = p->found[k].energy;
            b->label[to] = p->found[k].label;
            if (hits->colour != NULL) b->colour[to] = p->found[k].colour;
            b->ghost[to] = p->found[k].ghost;
        }
        b->count[at + i] = b->n - b->first[at + i];
    }
}

/* Casts the rays of the pool from `first` on. */
static void cast_pool(struct caster *c, const struct chunk *k, uint32_t first)
{
    const struct cast_setup *s = k->s;
    struct pool *p = &c->sub_rays->pool;
    int plain = s->detect == NULL && !caster_has_bodies(s), through = s->detect != NULL && s->detect->depth > 0;
    if (first == 0) c->sub_rays->beyond.n = 0;
    c->counters.sub_rays += p->n - first;
    for (uint32_t at = first, n; at < p->n; at += n) {
        n = p->n - at < CHUNK ? p->n - at : CHUNK;
        struct ray_hits hits = {.rays = {.n = n,
                                         .from.own = VEC3_IN(p->p, at),
                                         .dir = VEC3_IN(p->d, at),
                                         .range_max_m = s->range_max_m,
                                         .range_m = p->range_m + at,
                                         .triangle = p->triangle + at,
                                         .label = p->label + at},
                                .cosine = plain ? NULL : p->cosine + at,
                                .body = plain ? NULL : p->body + at,
                                .colour = k->texels ? p->colour + at : NULL};
        caster_nearest(&c->nearest, s, &hits);
        kernel_limit(hits.rays.range_m, 0.0, s->range_max_m, n); /* hits beyond may or may not have been reported */
        hits.rays.scattered = c->sub_rays->scattered;
        if (through) look_through(c, s, &hits, at);
        for (uint32_t i = at; i < at + n && caster_has_bodies(s); i++)
            if (p->body[i] != 0) p->triangle[i] = BVH_NO_TRIANGLE; /* a body's triangle, not the scene's */
    }
    weigh_pool(c, s, first);
}

/* Where a part of the footprint sees past the centre's hit, outlines beyond that hit cut the footprint, too. Plans the
 * parts that they make, and casts rays for these. */
static void look_secondary(struct caster *c, const struct chunk *k)
{
    const struct cast_setup *s = k->s;
    struct sub_ray_work *w = c->sub_rays;
    uint32_t first = w->pool.n;
    for (uint32_t j = 0; j < w->n_jobs; j++) {
        struct job *job = &w->job[j];
        double far_m = job->centre.energy > 0.0 ? job->centre.range_m : 0.0;
        if (!(job->next_m < INFINITY)) continue;
        for (uint32_t i = job->first; i < job->first + job->n; i++)
            far_m = isnan(w->pool.range_m[i]) ? (double)INFINITY : fmax(far_m, w->pool.range_m[i]);
        double limit_m = far_m + 4.0 * beam_radius(&s->beam->beam, far_m);
        if (job->next_m < limit_m) plan_parts(c, k, job, limit_m, job->lines);
    }
    if (w->pool.n != first) cast_pool(c, k, first);
}

/* Adds a return; rho is that of its surface. */
static void add_return(struct caster *c, const struct cast_setup *s, const struct beam_return *r, double share,
                       double rho)
{
    struct beam_return *to = &c->sub_rays->returns[c->sub_rays->n_returns];
    if (s->silent != NULL && s->silent[surface_of_label(r->label)]) {
        c->sub_rays->is_silenced = 1;
        return;
    }
    *to = *r;
    to->back = r->energy;
    if (s->detect != NULL && s->detect->surfaces != NULL) {
        if (caster_is_bare(s, r->label, rho)) return;
        to->back = r->energy * share * rho;
    }
    c->sub_rays->n_returns++;
}

static void add_centre(struct caster *c, const struct cast_setup *s, const struct job *job)
{
    double cosine = (double)(1.0f / sqrtf(c->sub_rays->steep[job->pulse])), rho = 0.0;
    if (s->detect != NULL && s->detect->surfaces != NULL)
        surface_return(s->detect->surfaces, 1, &job->centre.label, &cosine, &rho);
    add_return(c, s, &job->centre, 1.0, rho);
}

/* Returns sigma of the ranges within the part that sub-ray i of a job stands for. */
static float hit_sigma(const struct caster *c, const struct cast_setup *s, const struct job *job, uint32_t i)
{
    const struct pool *p = &c->sub_rays->pool;
    const struct beam *beam = &s->beam->beam;
    const struct beam_part part = {.xx = (double)p->xx[i], .xy = (double)p->xy[i], .yy = (double)p->yy[i]};
    if (p->triangle[i] == BVH_NO_TRIANGLE) /* on a body that moves: only the incidence is known */
        return beam_round_sigma(beam, p->range_m[i], p->cosine[i], part.xx);
    struct bvh_plane plane;
    bvh_get_plane(s->bvh, p->triangle[i], &plane);
    return beam_part_sigma(beam, &job->sight, plane.n, p->range_m[i], &part);
}

/* Returns whether the first hits of a job may make an echo that depends on their distances. Hits behind glass are not
 * looked at: where there is glass, the answer is yes. */
static int is_deep(const struct caster *c, const struct cast_setup *s, const struct job *job)
{
    const double *range_m = c->sub_rays->pool.range_m;
    double near_m = job->centre.energy > 0.0 ? job->centre.range_m : (double)INFINITY;
    double far_m = job->centre.energy > 0.0 ? job->centre.range_m : 0.0;
    if (caster_signal(s) == NULL || s->detect->depth > 0) return caster_signal(s) != NULL;
    for (uint32_t i = job->first; i < job->first + job->n; i++) {
        near_m = range_m[i] < near_m ? range_m[i] : near_m;
        far_m = range_m[i] > far_m ? range_m[i] : far_m;
    }
    return near_m < far_m && beam_is_deep(s->detect->signal, near_m, far_m - near_m, far_m - near_m);
}

/* Returns the range at which a job's axis meets the plane that sub-ray i has hit. On a body that moves, where only the
 * incidence is known, it is the range of the hit. */
static double axis_range(const struct caster *c, const struct chunk *k, const struct job *job, uint32_t i)
{
    const struct pool *p = &c->sub_rays->pool;
    const double dir[3] = VEC3_AT(p->d, i);
    double from_m[3] = VEC3_AT(p->p, i), axis_m[3];
    struct bvh_plane plane;
    if (p->triangle[i] == BVH_NO_TRIANGLE) return p->range_m[i];
    bvh_get_plane(k->s->bvh, p->triangle[i], &plane);
    bvh_origin_of(&k->from, job->pulse, axis_m);
    vec3_sub(from_m, axis_m, from_m);
    return (p->range_m[i] * vec3_dot(plane.n, dir) + vec3_dot(plane.n, from_m)) / vec3_dot(plane.n, job->sight.dir);
}

/* Adds the hits of sub-ray i of a job. deep: distances count. */
static void add_hits(struct caster *c, const struct chunk *k, const struct job *job, uint32_t i, int deep)
{
    const struct cast_setup *s = k->s;
    const struct pool *p = &c->sub_rays->pool;
    const struct beyond *b = &c->sub_rays->beyond;
    struct beam_return r = {.range_m = p->range_m[i], .energy = p->energy[i], .label = p->label[i]};
    if (isnan(p->range_m[i])) return;
    if (k->texels) r.colour = p->colour[i];
    if (k->spreads) r.sigma_m = hit_sigma(c, s, job, i);
    r.plane_m = deep ? axis_range(c, k, job, i) : r.range_m;
    add_return(c, s, &r, 1.0, p->rho[i]);
    if (s->detect == NULL || s->detect->depth == 0) return;
    for (uint32_t j = b->first[i]; j < b->first[i] + b->count[i]; j++) {
        r.range_m = r.plane_m = b->range_m[j];
        r.label = b->label[j];
        if (k->texels) r.colour = b->colour[j];
        if (k->spreads) r.sigma_m = beam_round_sigma(&s->beam->beam, r.range_m, b->cosine[j], (double)p->xx[i]);
        uint32_t before = c->sub_rays->n_returns;
        add_return(c, s, &r, b->share[j], b->rho[j]);
        if (b->ghost[j] && c->sub_rays->n_returns > before)
            c->sub_rays->returns[before].label += s->detect->ghost_label;
    }
}

/* Returns whether a part of an adaptive footprint lies on glass or a mirror: what is seen there has outlines of its
 * own. */
static int sees_through(const struct caster *c, const struct cast_setup *s, const struct job *job)
{
    if (job->whole || s->detect == NULL || s->detect->depth == 0) return 0;
    for (uint32_t i = job->first; i < job->first + job->n; i++)
        if (!isnan(c->sub_rays->pool.range_m[i]) && caster_goes_on(s, c->sub_rays->pool.label[i])) return 1;
    return 0;
}

/* Sets how the returns of a footprint are merged. */
static void set_merging(const struct cast_setup *s, uint32_t most, struct beam_merging *how)
{
    beam_merging(&s->beam->beam, most, how);
    how->signal = caster_signal(s);
    how->least_m = s->range_min_m;
}

/* Merges the returns of a job into echoes. */
static void finish_job(struct caster *c, const struct chunk *k, const struct job *job)
{
    struct sub_ray_work *w = c->sub_rays;
    const int deep = is_deep(c, k->s, job);
    struct beam_merging how;
    if (sees_through(c, k->s, job)) {
        w->again[w->n_again++] = job->pulse;
        return;
    }
    w->n_returns = 0;
    w->is_silenced = 0;
    if (job->centre.energy > 0.0) add_centre(c, k->s, job);
    for (uint32_t i = job->first; i < job->first + job->n; i++)
        add_hits(c, k, job, i, deep);
    /* Detection chooses among the echoes later. For it, as many are kept here as a pulse can have. */
    set_merging(k->s, k->s->detect != NULL ? LINE_MAX_ECHOES : caster_max_echoes(k->s), &how);
    uint32_t n = beam_merge(&how, w->returns, w->n_returns, &w->echo[w->n_echoes], &c->counters.crowded);
    c->counters.faint += w->is_silenced && n == 0;
    if (k->waves) waves_take_returns(c, k, job->pulse, w->returns, w->n_returns);
    w->echoes_of[job->pulse].first = w->n_echoes;
    w->echoes_of[job->pulse].n = n;
    w->n_echoes += n;
}

/* Returns whether beam_merge_alike can merge the returns of whole footprints. beam_merge_alike knows only ranges,
 * labels and the energy that comes back: no waveforms, colours, sigma of ranges, silent surfaces, or hits beyond the
 * first ones. */
static int are_alike(const struct chunk *k)
{
    const struct cast_setup *s = k->s;
    return s->beam->mode != BEAM_ADAPTIVE && s->silent == NULL && (s->detect == NULL || s->detect->depth == 0) &&
           !k->waves && !k->texels && !k->spreads;
}

/* Finishes BEAM_ALIKE jobs over whole footprints, from `first` on. */
static void finish_alike(struct caster *c, const struct chunk *k, uint32_t first)
{
    struct sub_ray_work *w = c->sub_rays;
    const struct pool *p = &w->pool;
    const struct cast_detect *d = k->s->detect;
    const uint32_t n = w->job[first].n, at = w->job[first].first;
    const struct beam_alike alike = {.n = n,
                                     .energy = p->energy[at],
                                     .range_m = p->range_m + at,
                                     .label = p->label + at,
                                     .rho = d != NULL && d->surfaces != NULL ? p->rho + at : NULL,
                                     .plane = caster_has_bodies(k->s) ? NULL : p->triangle + at};
    struct beam_merging how;
    struct beam_echo echo[BEAM_ALIKE];
    set_merging(k->s, 1, &how);
    const uint32_t merged = beam_merge_alike(&how, &alike, echo);
    for (uint32_t i = 0; i < BEAM_ALIKE; i++) {
        const struct job *job = &w->job[first + i];
        if ((merged >> i & 1) == 0) {
            finish_job(c, k, job);
            continue;
        }
        w->echoes_of[job->pulse].first = w->n_echoes;
        w->echoes_of[job->pulse].n = 1;
        w->echo[w->n_echoes++] = echo[i];
    }
}

static void run_jobs(struct caster *c, const struct chunk *k)
{
    struct sub_ray_work *w = c->sub_rays;
    cast_pool(c, k, 0);
    for (int pass = 0; pass < MAX_PASSES && k->s->beam->mode == BEAM_ADAPTIVE; pass++)
        look_secondary(c, k);
    uint32_t j = 0;
    for (; j + BEAM_ALIKE <= w->n_jobs && are_alike(k); j += BEAM_ALIKE)
        finish_alike(c, k, j);
    for (; j < w->n_jobs; j++)
        finish_job(c, k, &w->job[j]);
    w->n_jobs = w->pool.n = 0;
}

/* Whether there may be no room left for a pulse of `most` sub-rays. */
static int is_full(const struct sub_ray_work *w, uint32_t most)
{
    _Static_assert(MAX_PASSES * BEAM_MAX_PARTS + BEAM_MAX_SUBRAYS <= POOL, "room for a pulse");
    const uint32_t near = 8 * CHUNK, room = 32 * most > near ? POOL : near; /* `near` fits into a cache */
    return w->n_jobs == MAX_JOBS || (w->n_jobs + 1) * most > room;
}

/* Returns whether the centre of an adaptive beam hits glass or a mirror. */
static int sees_glass(const struct caster *c, const struct cast_setup *s, uint32_t pulse)
{
    const struct echo_list *l = &c->list;
    return s->detect != NULL && s->detect->depth > 0 && !isnan(l->range_m[pulse]) && caster_goes_on(s, l->label[pulse]);
}

/* Finds the pulses of an adaptive beam for which one ray may not be enough. */
static uint32_t find_candidates(struct caster *c, const struct chunk *k)
{
    struct sub_ray_work *w = c->sub_rays;
    const struct cast_setup *s = k->s;
    const uint32_t n = k->n;
    const struct vec3_floats dir = bvh_work_directions(c->nearest.bvh);
    const int glass = s->detect != NULL && s->detect->depth > 0;
    uint32_t found, all = 0;
    _Static_assert((int)CHUNK <= (int)BEAM_NEAR_MOST, "all at once");
    found = beam_near_outlines(s->beam->outlines, &s->beam->beam, &dir, n, glass ? w->reach : w->candidate);
    if (!glass) return found;
    for (uint32_t p = 0, at = 0; p < n; p++) {
        int near = at < found && w->reach[at].pulse == p;
        if (near || sees_glass(c, s, p)) w->candidate[all++] = near ? w->reach[at] : (struct beam_near){.pulse = p};
        at += (uint32_t)near;
    }
    return all;
}

/* Casts sub-rays over the whole footprints of these pulses. */
static void cast_whole(struct caster *c, const struct chunk *k, const uint32_t *pulse, uint32_t n)
{
    struct sub_ray_work *w = c->sub_rays;
    w->scattered = 0;
    for (uint32_t i = 0; i < n; i++) {
        if (is_full(w, k->s->beam->pattern.n)) run_jobs(c, k);
        struct job *job = &w->job[w->n_jobs++];
        job->pulse = pulse[i];
        plan_whole(c, k, job);
    }
    if (w->n_jobs > 0) run_jobs(c, k);
}

/* Returns the range up to which outlines may cut a footprint. The footprint's centre hits a surface at range_m; steep
 * is the incidence as 1 / cos^2. The limit lies 4 + 3 / cos radii of the footprint beyond the hit,
 * since the surface may bend away: a footprint on a plane reaches tan(incidence) radii beyond. */
static double limit_m(const struct beam *beam, double range_m, float steep)
{
    double s = steep < 1e6f ? (double)steep : 1e6;
    return isnan(range_m) ? (double)INFINITY : range_m + beam_radius(beam, range_m) * (4.0 + 3.0 * sqrt(s));
}

/* Casts rays for the parts of the candidates' footprints. */
static void cast_parts(struct caster *c, const struct chunk *k, uint32_t candidates)
{
    struct sub_ray_work *w = c->sub_rays;
    const struct cast_setup *s = k->s;
    const uint32_t most = MAX_PASSES * BEAM_MAX_PARTS + s->beam->pattern.n;
    w->scattered = 1;
    for (uint32_t i = 0; i < candidates; i++) {
        const uint32_t triangle = c->hit[w->candidate[i].pulse];
        if (triangle != BVH_NO_TRIANGLE) __builtin_prefetch(bvh_plane(s->bvh, triangle), 0, 3);
    }
    for (uint32_t i = 0; i < candidates; i++) {
        if (is_full(w, most)) run_jobs(c, k);
        struct job *job = &w->job[w->n_jobs];
        uint32_t pulse = job->pulse = w->candidate[i].pulse;
        job->near = &w->candidate[i];
        job->passes = 0;
        if (sees_glass(c, s, pulse)) {
            w->near[w->n_near++] = w->again[w->n_again++] = pulse;
            continue;
        }
        double limit = limit_m(&s->beam->beam, c->list.range_m[pulse], w->steep[pulse]);
        if (!plan_parts(c, k, job, limit, 0)) continue;
        w->near[w->n_near++] = pulse;
        w->n_jobs++;
    }
    if (w->n_jobs > 0) run_jobs(c, k);
}

/* Replaces the hits of the centres by the echoes of pulses with sub-rays. */
static void list_echoes(struct caster *c, const struct chunk *k)
{
    const struct sub_ray_work *w = c->sub_rays;
    struct echo_list *l = &c->list;
    for (uint32_t i = 0; i < w->n_near; i++) {
        const uint32_t pulse = w->near[i], n = w->echoes_of[pulse].n;
        const struct beam_echo *e = &w->echo[w->echoes_of[pulse].first];
        uint32_t rest = n > 1 ? echoes_secondary(l, pulse, n - 1) : 0;
        if (n == 0) l->range_m[pulse] = (double)NAN;
        for (uint32_t j = 0; j < n; j++) {
            uint32_t at = j == 0 ? pulse : rest + j - 1;
            l->range_m[at] = e[j].range_m;
            l->label[at] = e[j].label;
            l->number[at] = e[j].number;
            l->rho[at] = (double)(float)e[j].back; /* beam_merge compares them as floats, too */
            if (k->attributes) l->width_m[at] = e[j].width_m;
            if (k->texels) l->colour[at] = e[j].colour;
        }
    }
}

/* Finds how much comes back of pulses whose central ray stands for the whole footprint. */
static void weigh_central(struct caster *c, const struct chunk *k)
{
    struct echo_list *l = &c->list;
    const struct cast_detect *d = k->s->detect;
    for (uint32_t i = 0; i < k->n; i++) {
        l->cosine[i] = 1.0 / sqrt((double)c->sub_rays->steep[i]);
        l->rho[i] = 1.0;
    }
    if (d->surfaces != NULL) surface_return(d->surfaces, k->n, l->label, l->cosine, l->rho);
}

void caster_sub_rays(struct caster *c, const struct chunk *k)
{
    struct sub_ray_work *w = c->sub_rays;
    struct echo_list *l = &c->list;
    const struct cast_beam *b = k->s->beam;
    w->n_jobs = w->pool.n = w->n_echoes = w->n_near = w->n_again = 0;
    if (b->mode == BEAM_ADAPTIVE) {
        /* Hits beyond this range may or may not have been reported. */
        kernel_limit(l->range_m, 0.0, k->s->range_max_m, k->n);
        cast_parts(c, k, find_candidates(c, k));
        cast_whole(c, k, w->again, w->n_again);
        c->counters.outlined += w->n_near;
        beam_plane_means(&b->beam, w->steep, k->n, l->range_m);
        if (k->attributes) beam_plane_widths(&b->beam, w->steep, l->range_m, k->n, l->width_m);
        if (k->s->detect != NULL) weigh_central(c, k);
    } else {
        for (; w->n_near < k->n; w->n_near++)
            w->near[w->n_near] = w->n_near;
        cast_whole(c, k, w->near, k->n);
    }
    list_echoes(c, k);
}
