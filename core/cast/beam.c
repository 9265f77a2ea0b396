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
    ECHO_SHIFT = 56, /* pulse numbers stay below */
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
    uint32_t pulse, first, n;  /* its sub-rays */
    uint32_t lines;            /* outlines that cut it */
    double next_m;             /* from where on outlines were left out */
    struct beam_return centre; /* known without a ray; energy 0: none */
    double e1[3], e2[3];       /* across the beam */
};

/* A pulse of several points: its echoes in the list. */
struct several {
    uint32_t pulse, first, n;
};

struct beam_work {
    float steep[CHUNK], limit_m[CHUNK];
    uint32_t near[CHUNK]; /* pulses with sub-rays */
    struct job job[MAX_JOBS];
    uint32_t n_jobs;
    struct pool pool;
    struct beam_return returns[BEAM_MAX_SUBRAYS + 1];
    struct beam_echoes some; /* of pulses with sub-rays */
    /* per pulse, while c holds what is per point */
    double range_m[CHUNK], mirror_turn[CHUNK], pan_turn[CHUNK];
    double ex[CHUNK], ey[CHUNK], ez[CHUNK], px[CHUNK], py[CHUNK], pz[CHUNK];
    uint32_t label[CHUNK];
    struct several several[CHUNK];
    uint64_t counter[CHUNK]; /* of the points' random numbers */
};

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
    uint32_t lines = beam_find_lines(b->outlines, &b->beam, dir, limit_m, line, &job->next_m);
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
    c->scattered = s->beam->mode == BEAM_ADAPTIVE;
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
        kernel_limits(&b->beam, c->range_m, w->steep, n, w->limit_m);
        candidates = beam_near_outlines(b->outlines, c->fx, c->fy, c->fz, w->limit_m, n, w->near);
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
        } else if (!plan_job(c, s, from, job, (double)w->limit_m[job->pulse], 0)) {
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

static void copy_echo(struct beam_echoes *e, uint32_t to, uint32_t from)
{
    e->pulse[to] = e->pulse[from];
    e->range_m[to] = e->range_m[from];
    e->energy[to] = e->energy[from];
    e->cosine[to] = e->cosine[from];
    e->width_m[to] = e->width_m[from];
    e->triangle[to] = e->triangle[from];
    e->label[to] = e->label[from];
}

/* ---- THE PLACE FOR DETECTION: of pulses with sub-rays here, by their echoes' range, cosine, energy and label; of the
 * others in write_piece, from the ranges in c. What is not detected is left out, as echoes out of the head's range are.
 */
static void detect_echoes(const struct cast_setup *s, struct beam_echoes *e)
{
    uint32_t kept = 0;
    for (uint32_t i = 0; i < e->n; i++)
        if (e->range_m[i] >= s->range_min_m && e->range_m[i] <= s->range_max_m) {
            if (kept != i) copy_echo(e, kept, i);
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

static void keep(struct caster *c, const struct cast_setup *s, uint32_t n)
{
    struct beam_work *w = c->beam;
    const size_t bytes = n * sizeof(double);
    memcpy(w->range_m, c->range_m, bytes);
    memcpy(w->label, c->label, n * sizeof *w->label);
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

/* What pulses p .. p + n - 1 have in common with their points at k .. */
static void restore(struct caster *c, const struct cast_setup *s, uint32_t p, uint32_t n, uint32_t k)
{
    const struct beam_work *w = c->beam;
    const size_t bytes = n * sizeof(double);
    memcpy(c->mirror_turn + k, w->mirror_turn + p, bytes);
    memcpy(c->pan_turn + k, w->pan_turn + p, bytes);
    if (s->layout == LINE_GEO) {
        memcpy(c->ex + k, w->ex + p, bytes);
        memcpy(c->ey + k, w->ey + p, bytes);
        memcpy(c->ez + k, w->ez + p, bytes);
    }
    if (s->n_knots != 0) {
        memcpy(c->moving.px + k, w->px + p, bytes);
        memcpy(c->moving.py + k, w->py + p, bytes);
        memcpy(c->moving.pz + k, w->pz + p, bytes);
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

/* Points on their way into the block, CHUNK at most at a time. */
struct writer {
    struct caster *c;
    const struct cast_setup *s;
    struct line_block *block;
    const uint32_t *dt_ns;
    uint64_t pulse0;
    int linear;
    uint32_t at; /* the piece's first entry */
    uint32_t n, n_numbers, echoes;
    uint16_t numbered[CHUNK]; /* points of pulses with several */
    uint8_t number[CHUNK];
};

/* Keyed by pulse and echo; the first echo's is that of a single ray. */
static void write_noise(struct writer *w, uint32_t n)
{
    const struct cast_setup *s = w->s;
    double *range_m = w->c->range_m;
    for (uint32_t i = 0; i < n; i++)
        range_m[i] += (s->range_sigma_m + 1e-6 * s->range_sigma_ppm * range_m[i]) *
                      rng_normal(s->noise_key, w->c->beam->counter[i]);
}

static void write_piece(struct writer *w)
{
    struct caster *c = w->c;
    struct line_block *b = w->block;
    uint32_t n = w->n;
    if (n == 0) return;
    uint32_t echoes = kernel_detect(c->range_m, w->s->range_min_m, w->s->range_max_m, n, b->echo + w->at);
    kernel_labels(c->label, b->echo + w->at, n, b->label + w->at);
    for (uint32_t i = 0; i < n; i++)
        b->refl_cdb[w->at + i] = LINE_REFL_NONE;
    for (uint32_t i = 0; i < w->n_numbers; i++)
        b->echo[w->at + w->numbered[i]] = w->number[i];
    if (w->s->noise_on) write_noise(w, n);
    if (caster_wire(c, w->s, w->linear, b, w->at, n) != 0) {
        echoes = 0;
        n = drop_unfit(c, b, w->at, n, &echoes);
    }
    w->echoes += echoes;
    w->at += n;
    w->n = w->n_numbers = 0;
}

/* Pulses p .. end - 1, of one point each, whose ranges and labels are kept. */
static void write_plain(struct writer *w, uint32_t p, uint32_t end)
{
    const struct beam_work *kept = w->c->beam;
    while (p < end) {
        if (w->n == CHUNK) write_piece(w);
        uint32_t n = end - p < CHUNK - w->n ? end - p : CHUNK - w->n, k = w->n;
        restore(w->c, w->s, p, n, k);
        memcpy(w->c->range_m + k, kept->range_m + p, n * sizeof(double));
        memcpy(w->c->label + k, kept->label + p, n * sizeof(uint32_t));
        memmove(w->block->dt_ns + w->at + k, w->dt_ns + p, n * sizeof(uint32_t));
        if (w->s->noise_on)
            for (uint32_t i = 0; i < n; i++)
                w->c->beam->counter[k + i] = w->pulse0 + p + i;
        w->n += n;
        p += n;
    }
}

/* A pulse of several. */
static void write_several(struct writer *w, uint32_t p, const struct beam_echoes *e, uint32_t first, uint32_t count)
{
    if (w->n + count > CHUNK) write_piece(w);
    for (uint32_t i = 0; i < count; i++) {
        uint32_t k = w->n++;
        restore(w->c, w->s, p, 1, k);
        w->c->range_m[k] = e->range_m[first + i];
        w->c->label[k] = e->label[first + i];
        w->block->dt_ns[w->at + k] = w->dt_ns[p];
        w->c->beam->counter[k] = w->pulse0 + p + ((uint64_t)i << ECHO_SHIFT);
        w->numbered[w->n_numbers] = (uint16_t)k;
        w->number[w->n_numbers++] = (uint8_t)((i + 1) | count << 4);
    }
}

/* Pulses of a chunk with sub-rays are near[0 .. cut - 1], their echoes in e. Those that send one point become as the
 * plain ones, in c. Returns how many send several. */
static uint32_t make_plain(struct caster *c, const struct cast_setup *s, const struct beam_echoes *e, uint32_t cut,
                           struct several *several)
{
    struct beam_work *w = c->beam;
    uint32_t left = 0;
    for (uint32_t k = 0, i = 0, end; k < cut; k++, i = end) {
        uint32_t p = w->near[k];
        for (end = i; end < e->n && e->pulse[end] == p;)
            end++;
        if (end - i > 1 && s->echoes == BEAM_ALL) {
            several[left++] = (struct several){p, i, end - i};
            continue;
        }
        uint32_t one = end == i ? 0 : choose(e, s->echoes, i, end);
        c->range_m[p] = end == i ? (double)NAN : e->range_m[one];
        if (end != i) c->label[p] = e->label[one];
    }
    return left;
}

/* All pulses have one point each: they stand in c as they are. */
static void write_all_plain(struct writer *w, uint32_t n)
{
    if (w->dt_ns != w->block->dt_ns + w->at) memmove(w->block->dt_ns + w->at, w->dt_ns, n * sizeof *w->dt_ns);
    for (uint32_t i = 0; i < n && w->s->noise_on; i++)
        w->c->beam->counter[i] = w->pulse0 + i;
    w->n = n;
    write_piece(w);
}

static void write_points(struct writer *w, const struct beam_echoes *e, uint32_t n, uint32_t cut)
{
    struct several *several = w->c->beam->several;
    uint32_t left = make_plain(w->c, w->s, e, cut, several), from = 0;
    if (left == 0) {
        write_all_plain(w, n);
        return;
    }
    keep(w->c, w->s, n);
    for (uint32_t k = 0; k < left; k++) {
        write_plain(w, from, several[k].pulse);
        write_several(w, several[k].pulse, e, several[k].first, several[k].n);
        from = several[k].pulse + 1;
    }
    write_plain(w, from, n);
    write_piece(w);
}

uint32_t beam_chunk(struct caster *c, const struct cast_setup *s, const struct origins *from, int linear,
                    uint64_t pulse0, const uint32_t *dt_ns, uint32_t n, struct line_block *block, uint32_t *at)
{
    struct beam_work *w = c->beam;
    struct writer writer = {.c = c, .s = s, .block = block, .dt_ns = dt_ns, .pulse0 = pulse0, .linear = linear};
    writer.at = *at;
    uint32_t cut = sub_rays(c, s, from, n);
    if (s->beam->mode == BEAM_ADAPTIVE) kernel_excess(&s->beam->beam, w->steep, n, c->range_m);
    detect_echoes(s, &w->some);
    caster_ends(c, CAST_DETECT);
    write_points(&writer, &w->some, n, cut);
    caster_ends(c, CAST_POSITIONS);
    *at = writer.at;
    return writer.echoes;
}

float *beam_steep(struct caster *c)
{
    return c->beam->steep;
}
