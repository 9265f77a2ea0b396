/* SPDX-License-Identifier: MIT */
/* Echoes -> points, as entries of the block. Single rays and pulses of several echoes share this one writer. */
#include "core/cast/points.h"

#include <string.h>

#include "core/cast/aim.h"
#include "core/cast/caster.h"
#include "core/cast/colours.h"
#include "core/cast/kernels_aim.h"
#include "core/cast/kernels_moving.h"
#include "core/cast/kernels_points.h"
#include "core/colour.h"

/* Copies to secondary echoes what they share with the pulse's first one. */
static void follow_pulse(struct caster *c, const struct chunk *k)
{
    struct echo_list *l = &c->list;
    for (uint32_t g = 0; g < l->n_secondary; g++) {
        const struct secondary *f = &l->secondary[g];
        const double e[3] = VEC3_AT(l->e, f->pulse), p[3] = VEC3_AT(l->p, f->pulse);
        for (uint32_t i = f->at; i < f->at + f->n; i++) {
            l->mirror_turn[i] = l->mirror_turn[f->pulse];
            l->pan_turn[i] = l->pan_turn[f->pulse];
            if (k->s->layout == LINE_GEO) VEC3_SET(l->e, i, e);
            if (k->s->n_knots != 0) VEC3_SET(l->p, i, p);
        }
    }
}

/* Computes positions as a head does, from ranges and what its encoders read, and writes the three numbers of
 * echoes at .. at + n of the list. A number that doesn't fit into 32 bits becomes LINE_XYZ_NONE. Returns 0 where all
 * numbers fit. */
static uint32_t place(struct caster *c, const struct chunk *k, uint32_t at, uint32_t n, const struct kernel_wire *out)
{
    const struct cast_setup *s = k->s;
    struct echo_list *l = &c->list;
    const double *range_m = l->range_m + at;
    const struct vec3_out e = VEC3_OUT(l->e, at);
    if (s->layout != LINE_GEO) {
        kernel_polar(s, range_m, &(struct kernel_turns){n, l->mirror_turn + at, l->pan_turn + at}, out);
        return 0;
    }
    if (k->linear) return kernel_place(&VEC3_IN(e, 0), range_m, s->xyz_scale, n, out);
    if (s->n_knots != 0)
        kernel_scale_from(range_m, &VEC3_IN(l->p, at), s->station_m, n, &e);
    else
        kernel_scale(range_m, n, &e);
    georef_forward(s->georef, n, VEC3_IN(e, 0), e);
    return kernel_geo(&VEC3_IN(e, 0), s->xyz_scale, n, out);
}

static void put_colour(uint8_t to[3], uint32_t colour)
{
    for (int i = 0; i < 3; i++)
        to[i] = (uint8_t)(colour >> (16 - 8 * i));
}

/* Writes the first echoes of the pulses, except times and the three numbers. Returns the number of
 * echoes. */
static uint32_t write_firsts(struct caster *c, const struct chunk *k)
{
    const struct echo_list *l = &c->list;
    struct line_block *b = k->block;
    int16_t *refl_cdb = b->refl_cdb + k->at; /* a pointer of its own lets the loop become vector code */
    const uint8_t *echo = b->echo + k->at;
    const int signal = caster_signal(k->s) != NULL;
    uint32_t echoes = kernel_entries(l->range_m, l->label, k->n, b->echo + k->at, b->label + k->at);
    if (signal)
        kernel_values(l->refl_cdb, echo, k->n, (int16_t)LINE_REFL_NONE, refl_cdb);
    else
        for (uint32_t i = 0; i < k->n; i++)
            refl_cdb[i] = (int16_t)LINE_REFL_NONE;
    for (uint32_t i = 0; i < k->n && k->colours; i++)
        put_colour(b->rgb[k->at + i], l->colour[i]);
    if (!k->attributes) return echoes;
    kernel_widths(l->width_m, echo, k->n, b->width_cns + k->at);
    if (signal)
        kernel_values(l->amplitude_cdb, echo, k->n, (int16_t)LINE_AMPLITUDE_NONE, b->amplitude_cdb + k->at);
    else
        for (uint32_t i = 0; i < k->n; i++)
            b->amplitude_cdb[k->at + i] = (int16_t)LINE_AMPLITUDE_NONE;
    for (uint32_t i = 0; i < k->n && b->deviation != NULL; i++)
        b->deviation[k->at + i] = echo[i] != 0 ? l->deviation[i] : 0;
    return echoes;
}

/* Moves n entries of the block, except their times. */
static void move_entries(struct line_block *b, uint32_t to, uint32_t from, uint32_t n)
{
    memmove(b->a + to, b->a + from, n * sizeof *b->a);
    memmove(b->b + to, b->b + from, n * sizeof *b->b);
    memmove(b->c + to, b->c + from, n * sizeof *b->c);
    memmove(b->refl_cdb + to, b->refl_cdb + from, n * sizeof *b->refl_cdb);
    memmove(b->label + to, b->label + from, n * sizeof *b->label);
    memmove(b->echo + to, b->echo + from, n * sizeof *b->echo);
    if (b->rgb != NULL) memmove(b->rgb + to, b->rgb + from, n * sizeof *b->rgb);
    if (b->width_cns == NULL) return;
    memmove(b->width_cns + to, b->width_cns + from, n * sizeof *b->width_cns);
    memmove(b->amplitude_cdb + to, b->amplitude_cdb + from, n * sizeof *b->amplitude_cdb);
    if (b->deviation != NULL) memmove(b->deviation + to, b->deviation + from, n * sizeof *b->deviation);
}

/* Echo i of the list, number `echo` of its pulse, becomes entry `to`. */
static void write_secondary(struct caster *c, const struct chunk *k, uint32_t to, uint32_t i, uint8_t echo)
{
    const struct echo_list *l = &c->list;
    struct line_block *b = k->block;
    const int signal = caster_signal(k->s) != NULL;
    b->a[to] = c->secondary_a[i - k->n];
    b->b[to] = c->secondary_b[i - k->n];
    b->c[to] = c->secondary_c[i - k->n];
    b->refl_cdb[to] = signal ? l->refl_cdb[i] : (int16_t)LINE_REFL_NONE;
    b->label[to] = (uint16_t)l->label[i];
    b->echo[to] = echo;
    if (k->colours) put_colour(b->rgb[to], l->colour[i]);
    if (!k->attributes) return;
    kernel_widths(&l->width_m[i], &echo, 1, &b->width_cns[to]);
    b->amplitude_cdb[to] = signal ? l->amplitude_cdb[i] : (int16_t)LINE_AMPLITUDE_NONE;
    if (b->deviation != NULL) b->deviation[to] = l->deviation[i];
}

/* Inserts secondary echoes after the first ones of their pulses, beginning with the last pulse, which moves
 * furthest. */
static void insert_secondary(struct caster *c, const struct chunk *k)
{
    struct line_block *b = k->block;
    uint32_t to = k->at + c->list.n, end = k->n;
    for (uint32_t g = c->list.n_secondary; g-- > 0;) {
        const struct secondary *f = &c->list.secondary[g];
        const uint32_t count = f->n + 1, after = end - f->pulse - 1;
        if (f->n == 0) continue;
        to -= after;
        move_entries(b, to, k->at + f->pulse + 1, after);
        for (uint32_t j = f->n; j-- > 0;)
            write_secondary(c, k, --to, f->at + j, (uint8_t)((j + 2) | count << 4));
        to--;
        end = f->pulse;
        move_entries(b, to, k->at + end, 1);
        b->echo[to] = (uint8_t)(1 | count << 4);
    }
}

/* Writes the times of all entries, the first one first: the pulses' times may stand further on in the same array, and
 * in this order each is read before it is overwritten. */
static void write_times(const struct echo_list *l, const struct chunk *k)
{
    uint32_t *to = k->block->dt_ns + k->at, from = 0;
    for (uint32_t g = 0; g < l->n_secondary; g++) {
        const struct secondary *f = &l->secondary[g];
        uint32_t dt_ns = k->dt_ns[f->pulse];
        memmove(to, k->dt_ns + from, (f->pulse - from) * sizeof *to);
        to += f->pulse - from;
        for (uint32_t i = 0; i <= f->n; i++)
            *to++ = dt_ns;
        from = f->pulse + 1;
    }
    if (to != k->dt_ns + from) memmove(to, k->dt_ns + from, (k->n - from) * sizeof *to);
}

/* Moves entry `from`. If its position does not fit, it becomes a shot without echo. */
static void keep_entry(struct line_block *b, uint32_t to, uint32_t from, int fits)
{
    b->a[to] = b->a[from];
    b->b[to] = b->b[from];
    b->c[to] = b->c[from];
    b->dt_ns[to] = b->dt_ns[from];
    b->refl_cdb[to] = fits ? b->refl_cdb[from] : (int16_t)LINE_REFL_NONE;
    b->label[to] = fits ? b->label[from] : (uint16_t)LINE_LABEL_NONE;
    if (b->rgb != NULL) memmove(b->rgb[to], fits ? b->rgb[from] : colour_grey, sizeof *b->rgb);
    if (b->width_cns == NULL) return;
    b->amplitude_cdb[to] = fits ? b->amplitude_cdb[from] : (int16_t)LINE_AMPLITUDE_NONE;
    b->width_cns[to] = fits ? b->width_cns[from] : (uint16_t)LINE_WIDTH_NONE;
    if (b->deviation != NULL) b->deviation[to] = fits ? b->deviation[from] : 0;
}

/* Drops and counts echoes whose positions did not fit. The pulse's other echoes get new numbers; each pulse
 * keeps at least one entry. Returns how many of n entries are left; *echoes: how many of them are echoes. */
static uint32_t drop_unfit(struct caster *c, struct line_block *b, uint32_t at, uint32_t n, uint32_t *echoes)
{
    uint32_t to = at;
    *echoes = 0;
    for (uint32_t i = at, end; i < at + n; i = end) {
        uint32_t first = to, count = 0;
        for (end = i + 1; end < at + n && (b->echo[end] & 15) > 1;)
            end++;
        for (uint32_t k = i; k < end; k++) {
            int fits = b->a[k] != (uint32_t)LINE_XYZ_NONE && b->b[k] != (uint32_t)LINE_XYZ_NONE &&
                       b->c[k] != (uint32_t)LINE_XYZ_NONE;
            if (!fits && b->echo[k] != 0) c->counters.unfit++;
            if (!fits && (k + 1 < end || to > first)) continue; /* but one entry stays */
            keep_entry(b, to++, k, fits);
            count += (uint32_t)fits;
        }
        *echoes += count;
        for (uint32_t k = first; k < to; k++)
            b->echo[k] = (uint8_t)(count == 0 ? 0 : (k - first + 1) | count << 4);
        if (count == 0) b->a[first] = b->b[first] = b->c[first] = (uint32_t)LINE_XYZ_NONE;
    }
    return to - at;
}

uint32_t caster_points(struct caster *c, struct chunk *k)
{
    const struct cast_detect *d = k->s->detect;
    struct echo_list *l = &c->list;
    const struct line_block *b = k->block;
    const uint32_t secondary = l->n - k->n;
    uint32_t entries = l->n;
    if (secondary > 0) follow_pulse(c, k);
    if (d != NULL && d->ball != NULL) {
        const struct detect_points points = {l->n, l->key, l->range_m, l->mirror_turn, l->pan_turn, k->s->scan_key};
        detect_move_in_ball(d->ball, k->s->rotation, &points);
        caster_aim_read(c, k);
    }
    if (k->colours) caster_colours(k, c->d.z, l); /* by the ranges as they are sent: with ball-shaped noise */
    uint32_t echoes = write_firsts(c, k) + secondary;
    uint32_t unfit = place(c, k, 0, k->n, &(struct kernel_wire){b->a + k->at, b->b + k->at, b->c + k->at});
    if (secondary > 0) {
        unfit += place(c, k, k->n, secondary, &(struct kernel_wire){c->secondary_a, c->secondary_b, c->secondary_c});
        insert_secondary(c, k);
    }
    write_times(l, k);
    if (unfit != 0) entries = drop_unfit(c, k->block, k->at, l->n, &echoes);
    k->at += entries;
    bvh_stage_ends(c->profile, CAST_POSITIONS);
    return echoes;
}
