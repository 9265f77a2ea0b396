/* What was detected of a chunk -> entries of the block. */
#include <math.h>
#include <string.h>

#include "core/cast/caster_private.h"

static const double AS_IT_IS[9] = {1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0};

/* An echo of the pulse at hand. */
struct heard {
    double range_m, strength;
    uint64_t key;
    uint32_t label;
    int16_t refl_cdb;
    uint8_t entry; /* of the pulse's in the list */
};

static struct heard hear(const struct cast_detect *d, const struct echo_list *l, uint32_t first, uint32_t i)
{
    return (struct heard){.range_m = l->range_m[i],
                          .strength = d->signal != NULL ? l->amplitude[i] : l->rho[i],
                          .key = l->key[i],
                          .label = l->label[i] + (l->ghost[i] ? d->ghost_label : 0),
                          .refl_cdb = l->refl_cdb[i],
                          .entry = (uint8_t)(i - first)};
}

/* By range, as it is told: folding may have changed the order. */
static void sort_heard(struct heard *h, uint32_t n)
{
    for (uint32_t i = 1; i < n; i++)
        for (uint32_t k = i; k > 0 && h[k].range_m < h[k - 1].range_m; k--) {
            struct heard swap = h[k];
            h[k] = h[k - 1];
            h[k - 1] = swap;
        }
}

static uint32_t drop_weakest(struct heard *h, uint32_t n)
{
    uint32_t weakest = 0;
    for (uint32_t i = 1; i < n; i++)
        if (h[i].strength < h[weakest].strength) weakest = i;
    memmove(h + weakest, h + weakest + 1, (n - weakest - 1) * sizeof *h);
    return n - 1;
}

/* The echo that is asked for becomes the only one. */
static uint32_t choose(struct heard *h, uint32_t n, enum beam_select select)
{
    uint32_t best = select == BEAM_LAST ? n - 1 : 0;
    if (select == BEAM_ALL) return n;
    for (uint32_t i = 1; i < n && select == BEAM_STRONGEST; i++)
        if (h[i].strength > h[best].strength) best = i;
    h[0] = h[best];
    return 1;
}

/* The echoes that a pulse sends, of entries first .. end - 1. */
static uint32_t hear_pulse(struct caster *c, const struct cast_setup *s, uint32_t first, uint32_t end, struct heard *h)
{
    const struct cast_detect *d = s->detect;
    const struct echo_list *l = &c->list;
    uint32_t n = 0;
    for (uint32_t i = first; i < end; i++)
        if (!isnan(l->range_m[i])) h[n++] = hear(d, l, first, i);
    if (n < 2) return n;
    for (; n > d->max_echoes; c->counters.crowded++)
        n = drop_weakest(h, n);
    if (d->ambiguity == DETECT_FOLDED) sort_heard(h, n);
    return choose(h, n, s->echoes);
}

/* Of each pulse only the echoes that it sends stay, numbered, or one entry that says that there are none. Returns the
 * number of echoes. */
static uint32_t number_echoes(struct caster *c, const struct cast_setup *s)
{
    struct echo_list *l = &c->list;
    uint32_t total = 0, out = 0;
    for (uint32_t i = 0, end; i < l->n; i = end) {
        struct heard h[LINE_MAX_ECHOES];
        uint32_t pulse = l->pulse[i];
        for (end = i + 1; end < l->n && l->pulse[end] == pulse;)
            end++;
        uint32_t n = hear_pulse(c, s, i, end, h);
        if (n == 0) h[0] = (struct heard){.range_m = (double)NAN, .label = LINE_LABEL_NONE, .refl_cdb = LINE_REFL_NONE};
        for (uint32_t k = 0; k < (n > 0 ? n : 1); k++, out++) {
            l->pulse[out] = pulse;
            l->range_m[out] = h[k].range_m;
            l->label[out] = h[k].label;
            l->refl_cdb[out] = h[k].refl_cdb;
            l->key[out] = h[k].key;
            l->echo[out] = (uint8_t)(n > 0 ? (k + 1) | n << 4 : 0);
            if (c->attributes) l->from[out] = i + h[k].entry;
        }
        total += n;
    }
    l->n = out;
    return total;
}

/* Entries out .. of the block, but for their three numbers. */
static void write_entries(struct caster *c, const uint32_t *dt_ns, struct line_block *block, uint32_t out)
{
    struct echo_list *l = &c->list;
    for (uint32_t i = 0; i < l->n; i++) {
        uint32_t pulse = l->pulse[i];
        l->mirror_turn[i] = c->mirror_turn[pulse];
        l->pan_turn[i] = c->pan_turn[pulse];
        l->dt_ns[i] = dt_ns[pulse];
    }
    for (uint32_t i = 0; i < l->n; i++)
        block->label[out + i] = (uint16_t)l->label[i];
    memcpy(block->dt_ns + out, l->dt_ns, l->n * sizeof *l->dt_ns);
    memcpy(block->refl_cdb + out, l->refl_cdb, l->n * sizeof *l->refl_cdb);
    memcpy(block->echo + out, l->echo, l->n * sizeof *l->echo);
    if (c->attributes) caster_list_attributes(l, block, out);
}

/* Positions of entries, from what the encoders said. Returns how many echoes did not fit. */
static uint32_t write_positions(struct caster *c, const struct cast_setup *s, const struct schedule_run *run,
                                struct line_block *block, uint32_t out)
{
    struct echo_list *l = &c->list;
    struct moving_rays *m = &c->moving;
    uint32_t unfit = 0;
    double to_crs[9];
    int linear = s->n_knots == 0 && caster_reading_rotation(s, to_crs);
    for (uint32_t at = 0; at < l->n; at += CHUNK) {
        uint32_t n = l->n - at < CHUNK ? l->n - at : CHUNK;
        if (s->n_knots != 0) {
            kernel_directions_read(s, l->mirror_turn + at, l->pan_turn + at, AS_IT_IS, AS_IT_IS, n, m->sx, m->sy, m->sz,
                                   m->rx, m->ry, m->rz);
            caster_move(c, s, run->t0_ns, l->dt_ns + at, n, 1);
        } else {
            kernel_directions_read(s, l->mirror_turn + at, l->pan_turn + at, s->rotation, to_crs, n, c->dx, c->dy,
                                   c->dz, c->ex, c->ey, c->ez);
        }
        unfit += caster_wire(c, s, linear, l->range_m + at, block, out + at, n);
    }
    return unfit;
}

uint32_t caster_report(struct caster *c, const struct cast_setup *s, const struct schedule_run *run,
                       const uint32_t *dt_ns, struct line_block *block, uint32_t out, uint32_t *entries)
{
    const struct cast_detect *d = s->detect;
    struct echo_list *l = &c->list;
    uint32_t echoes = number_echoes(c, s);
    write_entries(c, dt_ns, block, out);
    if (d->ball != NULL)
        detect_move_in_ball(d->ball, s->rotation, l->n, l->key, l->range_m, l->mirror_turn, l->pan_turn);
    *entries = l->n;
    if (s->layout == LINE_POLAR) {
        kernel_polar(s, l->range_m, l->mirror_turn, l->pan_turn, l->n, block->a + out, block->b + out, block->c + out);
    } else {
        uint32_t unfit = write_positions(c, s, run, block, out);
        if (unfit != 0) *entries = caster_drop_unfit(c, block, out, l->n, &echoes);
    }
    caster_ends(c, CAST_POSITIONS);
    return echoes;
}
