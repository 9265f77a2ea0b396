/* Pulses with a footprint: central hits, and where they are not all, sub-rays -> echoes. */
#include "core/cast/beam_work.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/surface.h"

/* Pulses with fewer sub-rays than this share packets with their neighbours. */
enum { ALONE = 64 };

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

/* How much the surfaces send back that rays from `first` on have met. */
static void weigh_pool(struct caster *c, const struct cast_setup *s, uint32_t first)
{
    struct pool *p = &c->beam->pool;
    struct behind *b = &c->beam->behind;
    if (s->detect == NULL || s->detect->surfaces == NULL) return;
    surface_return(s->detect->surfaces, p->n - first, p->label + first, p->cosine + first, p->rho + first);
    if (s->detect->depth > 0) surface_return(s->detect->surfaces, b->n, b->label, b->cosine, b->rho);
}

/* What rays at .. at + n of the pool, which begin at `from`, come to behind what they have met. */
static void look_through(struct caster *c, const struct cast_setup *s, const struct origins *from,
                         const struct ray_set *met, uint32_t at, uint32_t n)
{
    const struct path_rays *p = &c->paths;
    struct behind *b = &c->beam->behind;
    caster_follow_rays(c, s, from, met, n);
    for (uint32_t i = 0; i < n; i++) {
        b->first[at + i] = b->n;
        for (uint32_t k = p->first[i]; k != CAST_NO_PATH; k = p->next[k]) {
            uint32_t to = b->n++;
            b->range_m[to] = p->found_m[k];
            b->cosine[to] = p->found_cosine[k];
            b->share[to] = p->found_energy[k];
            b->label[to] = p->found_label[k];
            b->ghost[to] = p->found_ghost[k];
        }
        b->count[at + i] = b->n - b->first[at + i];
    }
}

/* Whether these two pulses of a chunk may share a packet. */
static int together(uint32_t a, uint32_t b)
{
    return a / SCHEDULE_PACKET == b / SCHEDULE_PACKET;
}

/* Which rays share a packet hangs on the pulse number alone, as it does for those of the pulses: SCHEDULE_PACKET pulses
 * have packets of their own. */
static void mark_packets(struct beam_work *w, uint32_t first)
{
    const struct job *last = NULL;
    uint32_t n = 0; /* of rays in the packet */
    memset(w->pool.begins + first, 0, w->pool.n - first);
    for (uint32_t j = 0; j < w->n_jobs; j++) {
        const struct job *job = &w->job[j];
        if (job->first < first || job->n == 0) continue;
        if (last == NULL || !together(last->pulse, job->pulse) || last->n >= ALONE || job->n >= ALONE) n = 0;
        for (uint32_t i = job->first; i < job->first + job->n; i++, n++)
            w->pool.begins[i] = n % SCHEDULE_PACKET == 0;
        last = job;
    }
}

/* Casts what is in the pool from ray `first` on. */
static void cast_pool(struct caster *c, const struct cast_setup *s, uint32_t first)
{
    struct pool *p = &c->beam->pool;
    mark_packets(c->beam, first);
    int plain = s->detect == NULL && s->n_movers == 0, through = s->detect != NULL && s->detect->depth > 0;
    if (first == 0) c->beam->behind.n = 0;
    c->counters.sub_rays += p->n - first;
    for (uint32_t at = first, n; at < p->n; at += n) {
        n = p->n - at < CHUNK ? p->n - at : CHUNK;
        while (at + n < p->n && !p->begins[at + n])
            n--;
        const struct origins from = {.px = p->px + at, .py = p->py + at, .pz = p->pz + at};
        const struct ray_set set = {.dx = p->dx + at,
                                    .dy = p->dy + at,
                                    .dz = p->dz + at,
                                    .range_m = p->range_m + at,
                                    .label = p->label + at,
                                    .hit = p->triangle + at,
                                    .cosine = plain ? NULL : p->cosine + at,
                                    .body = plain ? NULL : p->body + at};
        c->begins = p->begins + at;
        caster_nearest(c, s, &from, &set, n);
        c->begins = NULL;
        c->scattered = c->beam->scattered;
        if (through) look_through(c, s, &from, &set, at, n);
        c->scattered = 0;
        for (uint32_t i = at; i < at + n && s->n_movers != 0; i++)
            if (p->body[i] != 0) p->triangle[i] = CAST_NO_TRIANGLE; /* not of the scene */
    }
    weigh_pool(c, s, first);
}

/* Outlines behind what the centre meets count too, where another part of the footprint looks past it. */
static void look_behind(struct caster *c, const struct cast_setup *s, const struct origins *from)
{
    struct beam_work *w = c->beam;
    uint32_t first = w->pool.n;
    for (uint32_t j = 0; j < w->n_jobs; j++) {
        struct job *job = &w->job[j];
        double far_m = job->centre.energy > 0.0 ? job->centre.range_m : 0.0;
        if (!(job->next_m < INFINITY)) continue;
        for (uint32_t i = job->first; i < job->first + job->n; i++)
            far_m = isnan(w->pool.range_m[i]) ? (double)INFINITY : fmax(far_m, w->pool.range_m[i]);
        double limit_m = far_m + 4.0 * beam_radius(&s->beam->beam, far_m);
        if (job->next_m < limit_m) beam_plan_job(c, s, from, job, limit_m, job->lines);
    }
    if (w->pool.n != first) cast_pool(c, s, first);
}

/* A return, with rho of its surface. */
static void add_return(struct caster *c, const struct cast_setup *s, const struct beam_return *r, double share,
                       double rho, int ghost)
{
    struct beam_return *to = &c->beam->returns[c->beam->n_returns];
    *to = *r;
    to->back = r->energy;
    if (s->detect != NULL && s->detect->surfaces != NULL) {
        if (caster_is_bare(s, r->label, rho)) return;
        to->back = r->energy * share * rho;
        to->label += ghost ? s->detect->ghost_label : 0;
    }
    c->beam->n_returns++;
}

static void add_centre(struct caster *c, const struct cast_setup *s, const struct beam_return *centre)
{
    double cosine = (double)centre->cosine, rho = 0.0;
    if (s->detect != NULL && s->detect->surfaces != NULL)
        surface_return(s->detect->surfaces, 1, &centre->label, &cosine, &rho);
    add_return(c, s, centre, 1.0, rho, 0);
}

/* Of the ranges within what sub-ray i of a job stands for. */
static float met_sigma(const struct caster *c, const struct cast_setup *s, const struct job *job, uint32_t i)
{
    const struct pool *p = &c->beam->pool;
    const struct beam *beam = &s->beam->beam;
    const double dir[3] = {c->dx[job->pulse], c->dy[job->pulse], c->dz[job->pulse]};
    if (p->triangle[i] == CAST_NO_TRIANGLE) /* of a body that moves, whole footprints, with an incidence */
        return beam_round_sigma(beam, p->range_m[i], p->cosine[i], (double)p->xx[i]);
    return beam_part_sigma(beam, dir, job, s->bvh->triangle[p->triangle[i]].n, p->range_m[i], (double)p->xx[i],
                           (double)p->xy[i], (double)p->yy[i]);
}

/* What sub-ray i of a job came to. */
static void add_met(struct caster *c, const struct cast_setup *s, const struct job *job, uint32_t i)
{
    const struct pool *p = &c->beam->pool;
    const struct behind *b = &c->beam->behind;
    struct beam_return r = {.range_m = p->range_m[i],
                            .energy = p->energy[i],
                            .cosine = s->detect != NULL ? (float)p->cosine[i] : 0.0f,
                            .triangle = p->triangle[i],
                            .label = p->label[i]};
    if (isnan(p->range_m[i])) return;
    if (c->attributes) r.sigma_m = met_sigma(c, s, job, i);
    add_return(c, s, &r, 1.0, p->rho[i], 0);
    if (s->detect == NULL || s->detect->depth == 0) return;
    for (uint32_t k = b->first[i]; k < b->first[i] + b->count[i]; k++) {
        r.range_m = b->range_m[k];
        r.cosine = (float)b->cosine[k];
        r.triangle = CAST_NO_TRIANGLE;
        r.label = b->label[k];
        if (c->attributes) r.sigma_m = beam_round_sigma(&s->beam->beam, r.range_m, b->cosine[k], (double)p->xx[i]);
        add_return(c, s, &r, b->share[k], b->rho[k], b->ghost[k]);
    }
}

/* Adaptive, and a part of the footprint lies on glass or a mirror: what can be seen there has outlines of its own. */
static int sees_through(const struct caster *c, const struct cast_setup *s, const struct job *job)
{
    if (job->whole || s->detect == NULL || s->detect->depth == 0) return 0;
    for (uint32_t i = job->first; i < job->first + job->n; i++)
        if (!isnan(c->beam->pool.range_m[i]) && caster_goes_on(s, c->beam->pool.label[i])) return 1;
    return 0;
}

/* The returns of a job as echoes. */
static void finish_job(struct caster *c, const struct cast_setup *s, const struct job *job)
{
    struct beam_work *w = c->beam;
    struct several *at = &w->several[job->pulse];
    /* Detection decides which of many are left out. */
    uint32_t most = s->detect != NULL ? LINE_MAX_ECHOES : s->beam->max_echoes;
    if (sees_through(c, s, job)) {
        w->again[w->n_again++] = job->pulse;
        return;
    }
    w->n_returns = 0;
    if (job->centre.energy > 0.0) add_centre(c, s, &job->centre);
    for (uint32_t i = job->first; i < job->first + job->n; i++)
        add_met(c, s, job, i);
    at->first = w->some.n;
    c->counters.crowded += beam_merge(&s->beam->beam, w->returns, w->n_returns, job->pulse, most, &w->some);
    at->n = w->some.n - at->first;
}

static void run_jobs(struct caster *c, const struct cast_setup *s, const struct origins *from)
{
    struct beam_work *w = c->beam;
    cast_pool(c, s, 0);
    for (int pass = 0; pass < MAX_PASSES && s->beam->mode == BEAM_ADAPTIVE; pass++)
        look_behind(c, s, from);
    for (uint32_t j = 0; j < w->n_jobs; j++)
        finish_job(c, s, &w->job[j]);
    w->n_jobs = w->pool.n = 0;
}

/* Whether there may be no room left for the pulses that share packets with this one, of `most` sub-rays each; asked
 * for each pulse, so that those before it that share its packets are all in. */
static int is_full(const struct beam_work *w, uint32_t pulse, uint32_t most)
{
    _Static_assert(SCHEDULE_PACKET * (MAX_PASSES * BEAM_MAX_PARTS + BEAM_MAX_SUBRAYS) <= POOL, "room for a packet");
    const uint32_t near = 8 * CHUNK; /* what stays in a cache, where that is enough */
    uint32_t jobs = w->n_jobs + SCHEDULE_PACKET, room = 2 * SCHEDULE_PACKET * most > near ? POOL : near;
    if (w->n_jobs == 0 || together(w->job[w->n_jobs - 1].pulse, pulse)) return 0;
    return jobs > MAX_JOBS || jobs * most > room;
}

/* The centre of an adaptive beam meets glass or a mirror. */
static int sees_glass(const struct caster *c, const struct cast_setup *s, uint32_t pulse)
{
    return s->detect != NULL && s->detect->depth > 0 && !isnan(c->range_m[pulse]) && caster_goes_on(s, c->label[pulse]);
}

/* Pulses of an adaptive beam that one ray may not do for. */
static uint32_t find_candidates(struct caster *c, const struct cast_setup *s, uint32_t n)
{
    struct beam_work *w = c->beam;
    uint32_t found = 0, all = 0;
    _Static_assert((int)CHUNK <= (int)BEAM_NEAR_MOST, "all at once");
    if (s->detect == NULL || s->detect->depth == 0)
        return beam_near_outlines(s->beam->outlines, &s->beam->beam, c->fx, c->fy, c->fz, n, w->candidate);
    found = beam_near_outlines(s->beam->outlines, &s->beam->beam, c->fx, c->fy, c->fz, n, w->reach);
    for (uint32_t p = 0, k = 0; p < n; p++) {
        int near = k < found && w->reach[k].pulse == p;
        if (near || sees_glass(c, s, p)) w->candidate[all++] = near ? w->reach[k] : (struct beam_near){.pulse = p};
        k += (uint32_t)near;
    }
    return all;
}

/* Sub-rays all over the footprints of these pulses. */
static void cast_whole(struct caster *c, const struct cast_setup *s, const struct origins *from, const uint32_t *pulse,
                       uint32_t n)
{
    struct beam_work *w = c->beam;
    w->scattered = 0;
    for (uint32_t k = 0; k < n; k++) {
        if (is_full(w, pulse[k], s->beam->pattern.n)) run_jobs(c, s, from);
        struct job *job = &w->job[w->n_jobs++];
        job->pulse = pulse[k];
        beam_plan_whole(c, s->beam, from, job);
    }
    if (w->n_jobs > 0) run_jobs(c, s, from);
}

/* Candidates of an adaptive beam: rays for the parts of their footprints. */
static void cast_parts(struct caster *c, const struct cast_setup *s, const struct origins *from, uint32_t candidates)
{
    struct beam_work *w = c->beam;
    const uint32_t most = MAX_PASSES * BEAM_MAX_PARTS + s->beam->pattern.n;
    w->scattered = 1;
    for (uint32_t k = 0; k < candidates; k++)
        __builtin_prefetch(&s->bvh->triangle[c->hit[w->candidate[k].pulse]], 0, 3);
    for (uint32_t k = 0; k < candidates; k++) {
        if (is_full(w, w->candidate[k].pulse, most)) run_jobs(c, s, from);
        struct job *job = &w->job[w->n_jobs];
        uint32_t pulse = job->pulse = w->candidate[k].pulse;
        job->near = &w->candidate[k];
        job->next_m = INFINITY;
        job->passes = 0;
        if (sees_glass(c, s, pulse)) {
            w->near[w->n_near++] = w->again[w->n_again++] = pulse;
            continue;
        }
        double limit_m = kernel_limit(&s->beam->beam, c->range_m[pulse], w->steep[pulse]);
        if (!beam_plan_job(c, s, from, job, limit_m, 0)) continue;
        w->near[w->n_near++] = pulse;
        w->n_jobs++;
    }
    if (w->n_jobs > 0) run_jobs(c, s, from);
}

/* Fills w->some with the echoes of pulses that one ray does not do for; gives those pulses in w->near. */
static void sub_rays(struct caster *c, const struct cast_setup *s, const struct origins *from, uint32_t n)
{
    struct beam_work *w = c->beam;
    w->n_jobs = w->pool.n = w->some.n = w->n_near = w->n_again = 0;
    if (s->beam->mode != BEAM_ADAPTIVE) {
        for (; w->n_near < n; w->n_near++)
            w->near[w->n_near] = w->n_near;
        cast_whole(c, s, from, w->near, n);
        return;
    }
    cast_parts(c, s, from, find_candidates(c, s, n));
    cast_whole(c, s, from, w->again, w->n_again);
    c->counters.outlined += w->n_near;
}

/* The central rays of an adaptive beam, with their incidences; nothing moves. */
static void cast_central(struct caster *c, const struct cast_setup *s, const struct origins *from, uint32_t n)
{
    c->steep = c->beam->steep;
    caster_hits_from(c, s->bvh, from, s->range_max_m, n, c->dx, c->dy, c->dz, c->range_m, c->hit);
    c->steep = NULL;
    memcpy(c->label, c->seen, n * sizeof *c->label);
    const struct ray_set set = {
        .dx = c->dx, .dy = c->dy, .dz = c->dz, .range_m = c->range_m, .label = c->label, .hit = c->hit};
    caster_texels(s, from, &set, n);
}

void beam_cast(struct caster *c, const struct cast_setup *s, const struct origins *from, uint32_t n)
{
    int adaptive = s->beam->mode == BEAM_ADAPTIVE;
    if (adaptive) cast_central(c, s, from, n);
    sub_rays(c, s, from, n);
    if (adaptive) kernel_excess(&s->beam->beam, c->beam->steep, n, c->range_m);
}
