/* SPDX-License-Identifier: MIT */
/* Turns the hits of a chunk's pulses into the echoes that the head reports. This file decides which echoes are
 * detected, how they merge, their noise, and which a pulse sends. There is one list for single rays, footprints, and
 * hits in glass and mirrors. */
#include "core/cast/echoes.h"

#include <math.h>
#include <string.h>

#include "core/cast/caster.h"
#include "core/cast/kernels_points.h"
#include "core/cast/disturbance.h"
#include "core/cast/waves.h"
#include "core/rng.h"
#include "core/surface.h"

uint32_t echoes_secondary(struct echo_list *l, uint32_t pulse, uint32_t n)
{
    uint32_t first = l->n;
    l->secondary[l->n_secondary++] = (struct secondary){pulse, first, n};
    l->n += n;
    return first;
}

/* Puts the hits on the paths of single rays into the list. */
static void list_paths(struct caster *c, const struct chunk *k)
{
    const struct path_rays *p = &c->paths;
    struct echo_list *l = &c->list;
    for (uint32_t i = 0; i < k->n; i++) {
        uint32_t n = 0;
        for (uint32_t j = p->first[i]; j != CAST_NO_PATH; j = p->found[j].next)
            n++;
        if (n == 0) continue;
        uint32_t at = echoes_secondary(l, i, n), number = 1;
        for (uint32_t j = p->first[i]; j != CAST_NO_PATH; j = p->found[j].next, at++) {
            const struct path_hit *hit = &p->found[j];
            l->range_m[at] = hit->range_m;
            l->cosine[at] = hit->cosine;
            l->energy[at] = hit->energy;
            l->label[at] = hit->label;
            l->ghost[at] = hit->ghost;
            if (k->texels) l->colour[at] = hit->colour;
            l->number[at] = (uint8_t)number++;
        }
    }
}

/* Returns the index of a pulse's echo j: its first one is in the pulse's place. */
static uint32_t echoes_place_of(const struct secondary *f, uint32_t j)
{
    return j == 0 ? f->pulse : f->at + j - 1;
}

static int comes_back(const struct echo_list *l, uint32_t i)
{
    return l->rho[i] > 0.0 && !isnan(l->range_m[i]);
}

/* Makes echo `at` of the list from several returns. */
static void take_echo(struct echo_list *l, uint32_t at, uint8_t number, const struct beam_echo *echo, int texels)
{
    if (texels) l->colour[at] = echo->colour;
    l->range_m[at] = echo->range_m;
    l->rho[at] = echo->back;
    l->label[at] = echo->label;
    l->width_m[at] = echo->width_m;
    l->number[at] = number;
}

/* Returns of a pulse that are nearer to each other than the range resolution make one echo. A return without power
 * is not merged, but it gets a number among the echoes. */
static uint32_t merge_pulse(struct echo_list *l, const struct beam_merging *how, const struct secondary *f, int texels)
{
    const uint32_t n = f->n + 1;
    struct beam_return r[LINE_MAX_ECHOES];
    struct beam_echo echo[LINE_MAX_ECHOES + 1];
    uint64_t left_out = 0;
    uint32_t to = 0;
    for (uint32_t j = 0; j < n; j++) {
        uint32_t i = echoes_place_of(f, j);
        r[j] = (struct beam_return){.range_m = l->range_m[i],
                                    .energy = l->rho[i],
                                    .back = l->rho[i],
                                    .label = l->label[i],
                                    .plane_m = l->range_m[i]};
        if (texels) r[j].colour = l->colour[i];
    }
    for (uint32_t j = 0, end; j < n; j = end) {
        uint32_t found = 1;
        for (end = j; end < n && comes_back(l, echoes_place_of(f, end));)
            end++;
        if (end > j) {
            found = beam_merge(how, r + j, end - j, echo, &left_out);
        } else {
            end = j + 1;
            echo[0] = (struct beam_echo){.range_m = r[j].range_m,
                                         .back = r[j].back,
                                         .width_m = (float)how->pulse_m,
                                         .label = r[j].label,
                                         .colour = r[j].colour};
        }
        for (uint32_t e = 0; e < found; e++, to++)
            take_echo(l, echoes_place_of(f, to), (uint8_t)to, &echo[e], texels);
    }
    return to - 1;
}

/* Finds how much of the pulse's energy comes back from each hit of a single ray, and merges hits of a pulse that are
 * near each other. */
static void weigh_returns(struct caster *c, const struct chunk *k)
{
    const struct cast_detect *d = k->s->detect;
    struct echo_list *l = &c->list;
    const struct beam_merging how = {
        .gap_m = d->separation_m, .pulse_m = k->s->pulse_m, .most = LINE_MAX_ECHOES, .signal = d->signal};
    if (d->surfaces == NULL) {
        for (uint32_t i = 0; i < k->n; i++)
            l->rho[i] = 1.0;
        return;
    }
    surface_return(d->surfaces, l->n, l->label, l->cosine, l->rho);
    if (d->depth == 0) return;             /* no echo has lost energy on its way */
    for (uint32_t i = k->n; i < l->n; i++) /* first echoes have all of it */
        l->rho[i] *= l->energy[i];
    for (uint32_t i = 0; i < l->n; i++)
        if (caster_is_bare(k->s, l->label[i], l->rho[i])) l->range_m[i] = (double)NAN;
    for (uint32_t i = k->n; i < l->n; i++)
        l->label[i] += l->ghost[i] ? d->ghost_label : 0;
    if (k->waves) waves_take_paths(c, k);
    for (uint32_t g = 0; g < l->n_secondary && d->separation_m > 0.0; g++)
        l->secondary[g].n = merge_pulse(l, &how, &l->secondary[g], k->texels);
}

/* Returns whether echoes are found in waveforms. Such echoes are detected already, and have their noise. */
static int finds_echoes(const struct chunk *k)
{
    return k->waves && k->s->waves->finds;
}

/* Ranges of echoes that are not detected become NaN. */
static void detect(struct caster *c, const struct chunk *k)
{
    const struct cast_detect *d = k->s->detect;
    const struct schedule_run *run = k->run;
    struct echo_list *l = &c->list;
    const struct detect_echoes echoes = {.n = l->n,
                                         .key = l->key,
                                         .range_m = l->range_m,
                                         .rho = l->rho,
                                         .amplitude = l->amplitude,
                                         .refl_cdb = l->refl_cdb,
                                         .scan_key = k->s->scan_key};
    uint32_t before = kernel_count_echoes(l->range_m, l->n);
    if (d->signal != NULL && !finds_echoes(k)) {
        if (k->s->disturbance != NULL) caster_weaken(k->s->disturbance, l->n, l->rho);
        detect_by_signal(d->signal, &echoes);
        if (k->attributes) detect_amplitudes(d->signal, &echoes, l->amplitude_cdb);
    }
    if (d->ambiguity != DETECT_AMBIGUITY_NONE)
        detect_zones(d->ambiguity, 1e-9 * ((double)run->ns_quot + (double)run->ns_rem / (double)run->ns_den), d->zones,
                     k->s->range_min_m, l->n, l->range_m);
    c->counters.faint += before - kernel_count_echoes(l->range_m, l->n);
}

/* A user who sets fixed noise together with a signal model wants it fixed: a soiled window does not change it then. */
static double fixed_sigma_m(const struct cast_setup *s)
{
    const int is_modelled = caster_signal(s) != NULL;
    return s->disturbance != NULL && !is_modelled ? s->range_sigma_m / s->disturbance->share : s->range_sigma_m;
}

static void lose_low_echo(struct caster *c, uint32_t i, double limit_m)
{
    if (!(c->list.range_m[i] <= limit_m)) return;
    c->list.range_m[i] = (double)NAN;
    c->counters.faint++;
}

/* No head measures a range of 0 or less, or one that rounds to 0 in the counts of polar. Noise and range errors of the
 * instrument may move a near hit there. Such an echo is lost. */
static void lose_low(struct caster *c, const struct chunk *k)
{
    const double limit_m = k->s->layout == LINE_GEO ? 0.0 : 0.5 * k->s->range_scale_m;
    struct echo_list *l = &c->list;
    if (!kernel_has_low(l->range_m, limit_m, l->n)) return;
    for (uint32_t i = 0; i < k->n; i++)
        lose_low_echo(c, i, limit_m);
    for (uint32_t g = 0; g < l->n_secondary; g++)
        for (uint32_t j = 0; j < l->secondary[g].n; j++)
            lose_low_echo(c, l->secondary[g].at + j, limit_m);
}

/* Noise is keyed by scan, pulse and echo, so that it doesn't depend on which other echoes are sent. */
static void add_noise(struct caster *c, const struct chunk *k)
{
    const struct cast_setup *s = k->s;
    const struct cast_detect *d = s->detect;
    struct echo_list *l = &c->list;
    const struct detect_echoes echoes = {
        .n = l->n, .key = l->key, .range_m = l->range_m, .amplitude = l->amplitude, .scan_key = s->scan_key};
    if (d != NULL && d->noise_by_signal)
        detect_range_noise(d->signal, &echoes);
    else if (s->noise_on)
        detect_fixed_noise(fixed_sigma_m(s), 1e-6 * s->range_sigma_ppm, s->noise_key ^ s->scan_key, l->n, l->key,
                           l->range_m);
    if (d != NULL && d->instrument != NULL) instrument_range(d->instrument, l->n, l->range_m);
    if (s->noise_on || (d != NULL && (d->noise_by_signal || d->instrument != NULL))) lose_low(c, k);
}

static void make_keys(struct echo_list *l, const struct chunk *k)
{
    kernel_keys(k->pulse0, l->number, k->n, l->key);
    for (uint32_t g = 0; g < l->n_secondary; g++) {
        const struct secondary *f = &l->secondary[g];
        for (uint32_t i = f->at; i < f->at + f->n; i++)
            l->key[i] = rng_echo(k->pulse0 + f->pulse, l->number[i]);
    }
}

/* An echo of the current pulse. */
struct pulse_echo {
    double range_m, strength;
    uint64_t key;
    uint32_t label;
    int16_t refl_cdb, amplitude_cdb;
    uint16_t deviation;
    float width_m;
    uint32_t colour;
};

static uint32_t take_echoes(const struct echo_list *l, const double *strength, const struct secondary *f,
                            struct pulse_echo *h)
{
    uint32_t n = 0;
    for (uint32_t j = 0; j <= f->n; j++) {
        uint32_t i = echoes_place_of(f, j);
        if (!isnan(l->range_m[i]))
            h[n++] =
                (struct pulse_echo){l->range_m[i],       strength[i],     l->key[i],     l->label[i], l->refl_cdb[i],
                                    l->amplitude_cdb[i], l->deviation[i], l->width_m[i], l->colour[i]};
    }
    return n;
}

/* Sorts by the range that is sent: noise, and the range ambiguity of DETECT_FOLDED, may have changed the order. */
static void sort_echoes(struct pulse_echo *h, uint32_t n)
{
    for (uint32_t i = 1; i < n; i++)
        for (uint32_t k = i; k > 0 && h[k].range_m < h[k - 1].range_m; k--) {
            struct pulse_echo swap = h[k];
            h[k] = h[k - 1];
            h[k - 1] = swap;
        }
}

static uint32_t drop_weakest(struct pulse_echo *h, uint32_t n)
{
    uint32_t weakest = 0;
    for (uint32_t i = 1; i < n; i++)
        if (h[i].strength < h[weakest].strength) weakest = i;
    memmove(h + weakest, h + weakest + 1, (n - weakest - 1) * sizeof *h);
    return n - 1;
}

/* Keeps only the echo that is asked for, or all echoes with BEAM_ALL. */
static uint32_t choose(struct pulse_echo *h, uint32_t n, enum beam_select select)
{
    uint32_t best = select == BEAM_LAST ? n - 1 : 0;
    if (select == BEAM_ALL || n < 2) return n;
    for (uint32_t i = 1; i < n && select == BEAM_STRONGEST; i++)
        if (h[i].strength > h[best].strength) best = i;
    h[0] = h[best];
    return 1;
}

uint32_t caster_max_echoes(const struct cast_setup *s)
{
    const uint32_t most = s->detect != NULL ? s->detect->max_echoes : s->beam->max_echoes;
    return s->max_echoes != 0 && s->max_echoes < most ? s->max_echoes : most;
}

/* Keeps in the list only those echoes of a pulse that are sent. */
static void choose_echoes(struct caster *c, const struct chunk *k)
{
    const struct cast_setup *s = k->s;
    struct echo_list *l = &c->list;
    const double *strength = caster_signal(s) != NULL ? l->amplitude : l->rho;
    const uint32_t most = caster_max_echoes(s);
    uint32_t end = k->n;
    for (uint32_t g = 0; g < l->n_secondary; g++) {
        struct pulse_echo h[LINE_MAX_ECHOES];
        struct secondary *f = &l->secondary[g];
        uint32_t n = take_echoes(l, strength, f, h);
        for (; n > most && n > 1; c->counters.crowded++)
            n = drop_weakest(h, n);
        if (s->noise_on || (s->detect != NULL && s->detect->ambiguity == DETECT_FOLDED)) sort_echoes(h, n);
        n = choose(h, n, s->echoes);
        *f = (struct secondary){f->pulse, end, n > 1 ? n - 1 : 0};
        end += f->n;
        if (n == 0) l->range_m[f->pulse] = (double)NAN;
        for (uint32_t j = 0; j < n; j++) {
            uint32_t i = echoes_place_of(f, j);
            l->range_m[i] = h[j].range_m;
            l->label[i] = h[j].label;
            l->key[i] = h[j].key;
            l->refl_cdb[i] = h[j].refl_cdb;
            l->amplitude_cdb[i] = h[j].amplitude_cdb;
            l->deviation[i] = h[j].deviation;
            l->width_m[i] = h[j].width_m;
            if (k->texels) l->colour[i] = h[j].colour;
        }
    }
    l->n = end;
}

/* Removes hits on surfaces that give no echo. */
static void silence(struct caster *c, const struct cast_setup *s)
{
    struct echo_list *l = &c->list;
    for (uint32_t i = 0; i < l->n; i++) {
        if (isnan(l->range_m[i]) || !s->silent[surface_of_label(l->label[i])]) continue;
        l->range_m[i] = (double)NAN;
        c->counters.faint++;
    }
}

void caster_echoes(struct caster *c, const struct chunk *k)
{
    const struct cast_setup *s = k->s;
    struct echo_list *l = &c->list;
    if (s->beam == NULL && s->detect != NULL && s->detect->depth > 0) list_paths(c, k);
    kernel_limit(l->range_m, s->range_min_m, s->range_max_m, l->n);
    if (s->silent != NULL) silence(c, s);
    if (s->beam == NULL && s->detect != NULL) weigh_returns(c, k);
    caster_report(c, k);
}

void caster_report(struct caster *c, const struct chunk *k)
{
    const struct cast_setup *s = k->s;
    struct echo_list *l = &c->list;
    if (k->waves) caster_waves(c, k);
    if (s->detect != NULL || s->noise_on) make_keys(l, k);
    if (s->detect != NULL) detect(c, k);
    bvh_stage_ends(c->profile, CAST_DETECT);
    if (!finds_echoes(k)) add_noise(c, k);
    bvh_stage_ends(c->profile, CAST_NOISE);
    if (l->n_secondary > 0) choose_echoes(c, k);
}
