/* Echoes of pulses with a footprint -> points: which are sent, their numbers, noise, positions. */
#include <math.h>
#include <string.h>

#include "core/cast/beam_private.h"
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

/* Keyed by pulse and echo, whether others are sent or not; the first echo's is that of a single ray. */
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
    if (caster_wire(c, w->s, w->linear, c->range_m, b, w->at, n) != 0) {
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
                w->c->beam->counter[k + i] = rng_echo(w->pulse0 + p + i, kept->number[p + i]);
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
        w->c->beam->counter[k] = rng_echo(w->pulse0 + p, e->number[first + i]);
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
        if (end == i) continue;
        c->label[p] = e->label[one];
        w->number[p] = e->number[one];
    }
    return left;
}

/* All pulses have one point each: they stand in c as they are. */
static void write_all_plain(struct writer *w, uint32_t n)
{
    if (w->dt_ns != w->block->dt_ns + w->at) memmove(w->block->dt_ns + w->at, w->dt_ns, n * sizeof *w->dt_ns);
    for (uint32_t i = 0; i < n && w->s->noise_on; i++)
        w->c->beam->counter[i] = rng_echo(w->pulse0 + i, w->c->beam->number[i]);
    w->n = n;
    write_piece(w);
}

static void write_points(struct writer *w, const struct beam_echoes *e, uint32_t n, uint32_t cut)
{
    struct several *several = w->c->beam->several;
    if (w->s->noise_on) memset(w->c->beam->number, 0, n);
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

uint32_t beam_write_points(struct caster *c, const struct cast_setup *s, int linear, uint64_t pulse0,
                           const uint32_t *dt_ns, uint32_t n, struct line_block *block, uint32_t *at)
{
    struct writer writer = {.c = c, .s = s, .block = block, .dt_ns = dt_ns, .pulse0 = pulse0, .linear = linear};
    writer.at = *at;
    detect_echoes(s, &c->beam->some);
    caster_ends(c, CAST_DETECT);
    write_points(&writer, &c->beam->some, n, c->beam->n_near);
    caster_ends(c, CAST_POSITIONS);
    *at = writer.at;
    return writer.echoes;
}
