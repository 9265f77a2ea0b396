/* Echoes of pulses with a footprint -> points: which are sent, their numbers, noise, positions. */
#include <math.h>
#include <string.h>

#include "core/cast/beam_work.h"
#include "core/rng.h"

static void copy_echo(struct beam_echoes *e, uint32_t to, uint32_t from)
{
    e->pulse[to] = e->pulse[from];
    e->range_m[to] = e->range_m[from];
    e->energy[to] = e->energy[from];
    e->cosine[to] = e->cosine[from];
    e->width_m[to] = e->width_m[from];
    e->triangle[to] = e->triangle[from];
    e->label[to] = e->label[from];
    e->number[to] = e->number[from];
}

/* Echoes out of the head's range are left out. */
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

/* What pulses of several points have in common with them, before the others' positions overwrite it. */
static void keep(struct caster *c, const struct cast_setup *s, uint32_t left)
{
    struct beam_work *w = c->beam;
    for (uint32_t k = 0; k < left; k++) {
        const uint32_t p = w->several[k].pulse;
        w->mirror_turn[k] = c->mirror_turn[p];
        w->pan_turn[k] = c->pan_turn[p];
        if (s->layout == LINE_GEO) {
            w->ex[k] = c->ex[p];
            w->ey[k] = c->ey[p];
            w->ez[k] = c->ez[p];
        }
        if (s->n_knots != 0) {
            w->px[k] = c->moving.px[p];
            w->py[k] = c->moving.py[p];
            w->pz[k] = c->moving.pz[p];
        }
    }
}

/* Point i gets what was kept of pulse k. */
static void restore(struct caster *c, const struct cast_setup *s, uint32_t k, uint32_t i)
{
    const struct beam_work *w = c->beam;
    c->mirror_turn[i] = w->mirror_turn[k];
    c->pan_turn[i] = w->pan_turn[k];
    if (s->layout == LINE_GEO) {
        c->ex[i] = w->ex[k];
        c->ey[i] = w->ey[k];
        c->ez[i] = w->ez[k];
    }
    if (s->n_knots != 0) {
        c->moving.px[i] = w->px[k];
        c->moving.py[i] = w->py[k];
        c->moving.pz[i] = w->pz[k];
    }
}

/* A chunk on its way into the block. */
struct writer {
    struct caster *c;
    const struct cast_setup *s;
    struct line_block *block;
    const uint32_t *dt_ns; /* of the pulses */
    uint64_t pulse0;
    int linear;
    uint32_t at, n, left; /* the chunk's first entry; pulses; those of several points */
    uint32_t echoes, unfit;
};

/* Keyed by pulse and echo, whether others are sent or not; the first echo's is that of a single ray. */
static void write_noise(struct writer *w, uint32_t n)
{
    const struct cast_setup *s = w->s;
    double *range_m = w->c->range_m;
    for (uint32_t i = 0; i < n; i++)
        range_m[i] += (s->range_sigma_m + 1e-6 * s->range_sigma_ppm * range_m[i]) *
                      rng_normal(s->noise_key, w->c->beam->counter[i]);
}

/* Each pulse's only or first point, which stand in c as they are; no times yet. */
static void write_firsts(struct writer *w)
{
    struct caster *c = w->c;
    struct line_block *b = w->block;
    const uint32_t n = w->n, at = w->at;
    w->echoes = kernel_detect(c->range_m, w->s->range_min_m, w->s->range_max_m, n, b->echo + at);
    kernel_labels(c->label, b->echo + at, n, b->label + at);
    if (c->attributes) caster_widths(b, at, c->beam->width_m, n);
    for (uint32_t i = 0; i < n && w->s->noise_on; i++)
        c->beam->counter[i] = rng_echo(w->pulse0 + i, c->beam->number[i]);
    if (w->s->noise_on) write_noise(w, n);
    w->unfit = caster_wire(c, w->s, w->linear, c->range_m, b, at, n);
}

/* The further points, CHUNK at most at a time: positions into `more`. Returns how many. */
static uint32_t write_further(struct writer *w, const struct beam_echoes *e, struct line_block *more)
{
    struct caster *c = w->c;
    uint32_t done = 0, n = 0;
    for (uint32_t k = 0; k < w->left; k++) {
        const struct several *of = &c->beam->several[k];
        for (uint32_t i = of->first + 1; i < of->first + of->n; i++, n++) {
            if (n == CHUNK) {
                if (w->s->noise_on) write_noise(w, n);
                w->unfit += caster_wire(c, w->s, w->linear, c->range_m, more, done, n);
                done += n;
                n = 0;
            }
            restore(c, w->s, k, n);
            c->range_m[n] = e->range_m[i];
            c->beam->counter[n] = rng_echo(w->pulse0 + of->pulse, e->number[i]);
        }
    }
    if (w->s->noise_on) write_noise(w, n);
    w->unfit += caster_wire(c, w->s, w->linear, c->range_m, more, done, n);
    return done + n;
}

/* n entries of the block, but for their times. */
static void move_entries(struct line_block *b, uint32_t to, uint32_t from, uint32_t n)
{
    memmove(b->a + to, b->a + from, n * sizeof *b->a);
    memmove(b->b + to, b->b + from, n * sizeof *b->b);
    memmove(b->c + to, b->c + from, n * sizeof *b->c);
    memmove(b->label + to, b->label + from, n * sizeof *b->label);
    memmove(b->echo + to, b->echo + from, n * sizeof *b->echo);
    if (b->width_cns != NULL) memmove(b->width_cns + to, b->width_cns + from, n * sizeof *b->width_cns);
}

/* The further points go behind the first ones of their pulses: from the last one on, which moves furthest. */
static void insert_further(struct writer *w, const struct beam_echoes *e, const struct line_block *more, uint32_t n)
{
    struct line_block *b = w->block;
    uint32_t to = w->at + w->n + n, end = w->n;
    for (uint32_t k = w->left; k-- > 0;) {
        const struct several *of = &w->c->beam->several[k];
        uint32_t behind = end - of->pulse - 1;
        to -= behind;
        move_entries(b, to, w->at + of->pulse + 1, behind);
        for (uint32_t i = of->n; i-- > 1;) {
            to--;
            n--;
            b->a[to] = more->a[n];
            b->b[to] = more->b[n];
            b->c[to] = more->c[n];
            b->label[to] = (uint16_t)e->label[of->first + i];
            if (b->width_cns != NULL) b->width_cns[to] = caster_width(e->width_m[of->first + i]);
            b->echo[to] = (uint8_t)((i + 1) | of->n << 4);
        }
        to--;
        end = of->pulse;
        move_entries(b, to, w->at + end, 1);
        b->echo[to] = (uint8_t)(1 | of->n << 4);
    }
}

/* Times of all entries. They may wait in the same array, further on: from the first one on. */
static void write_times(struct writer *w)
{
    uint32_t *to = w->block->dt_ns + w->at, from = 0;
    for (uint32_t k = 0; k < w->left; k++) {
        const struct several *of = &w->c->beam->several[k];
        uint32_t dt_ns = w->dt_ns[of->pulse];
        memmove(to, w->dt_ns + from, (of->pulse - from) * sizeof *to);
        to += of->pulse - from;
        for (uint32_t i = 0; i < of->n; i++)
            *to++ = dt_ns;
        from = of->pulse + 1;
    }
    if (to != w->dt_ns + from) memmove(to, w->dt_ns + from, (w->n - from) * sizeof *to);
}

/* Pulses of a chunk with sub-rays are near[0 .. cut - 1], their echoes in e. What they send, or of several the
 * first, becomes as with the plain ones, in c. Returns how many send several. */
static uint32_t make_plain(struct caster *c, const struct cast_setup *s, const struct beam_echoes *e, uint32_t cut,
                           struct several *several)
{
    struct beam_work *w = c->beam;
    uint32_t left = 0;
    for (uint32_t k = 0, i = 0, end; k < cut; k++, i = end) {
        uint32_t p = w->near[k];
        for (end = i; end < e->n && e->pulse[end] == p;)
            end++;
        int all = end - i > 1 && s->echoes == BEAM_ALL;
        if (all) several[left++] = (struct several){p, i, end - i};
        uint32_t one = end == i ? 0 : all ? i : choose(e, s->echoes, i, end);
        c->range_m[p] = end == i ? (double)NAN : e->range_m[one];
        if (end == i) continue;
        c->label[p] = e->label[one];
        w->number[p] = e->number[one];
        if (c->attributes) w->width_m[p] = e->width_m[one];
    }
    return left;
}

static void write_points(struct writer *w, const struct beam_echoes *e, uint32_t cut)
{
    struct caster *c = w->c;
    struct beam_work *work = c->beam;
    struct line_block more = {.a = work->a, .b = work->b, .c = work->c};
    uint32_t n = w->n;
    if (w->s->noise_on) memset(work->number, 0, n);
    if (c->attributes && w->s->beam->mode == BEAM_ADAPTIVE)
        caster_plane_widths(&w->s->beam->beam, work->steep, c->range_m, n, work->width_m);
    w->left = make_plain(c, w->s, e, cut, work->several);
    keep(c, w->s, w->left);
    write_firsts(w);
    if (w->left != 0) {
        uint32_t further = write_further(w, e, &more);
        insert_further(w, e, &more, further);
        w->echoes += further;
        n += further;
    }
    write_times(w);
    caster_no_reflectance(w->block, w->at, n);
    if (c->attributes) caster_no_amplitudes(w->block, w->at, n);
    if (w->unfit != 0) {
        n = caster_drop_unfit(c, w->block, w->at, n, &w->echoes);
    }
    w->at += n;
}

uint32_t beam_write_points(struct caster *c, const struct cast_setup *s, int linear, uint64_t pulse0,
                           const uint32_t *dt_ns, uint32_t n, struct line_block *block, uint32_t *at)
{
    struct writer writer = {.c = c, .s = s, .block = block, .dt_ns = dt_ns, .pulse0 = pulse0, .linear = linear, .n = n};
    writer.at = *at;
    detect_echoes(s, &c->beam->some);
    caster_ends(c, CAST_DETECT);
    write_points(&writer, &c->beam->some, c->beam->n_near);
    caster_ends(c, CAST_POSITIONS);
    *at = writer.at;
    return writer.echoes;
}
