/* A chunk of pulses with everything between a hit and a point that a configuration asks for. */
#include <math.h>
#include <string.h>

#include "core/cast/caster_private.h"
#include "core/rng.h"

/* One hit for each pulse. */
static void list_hits(struct caster *c, uint32_t n)
{
    struct echo_list *l = &c->list;
    l->n = n;
    memcpy(l->range_m, c->range_m, n * sizeof *l->range_m);
    memcpy(l->cosine, c->cosine, n * sizeof *l->cosine);
    memcpy(l->label, c->label, n * sizeof *l->label);
    memset(l->ghost, 0, n * sizeof *l->ghost);
    memset(l->number, 0, n * sizeof *l->number);
    for (uint32_t i = 0; i < n; i++) {
        l->pulse[i] = i;
        l->energy[i] = 1.0;
    }
}

static void make_keys(struct echo_list *l, uint64_t pulse0)
{
    for (uint32_t i = 0; i < l->n; i++)
        l->key[i] = rng_echo(pulse0 + l->pulse[i], l->number[i]);
}

static uint32_t count_echoes(const struct echo_list *l)
{
    uint32_t n = 0;
    for (uint32_t i = 0; i < l->n; i++)
        n += l->range_m[i] == l->range_m[i];
    return n;
}

int caster_is_bare(const struct cast_setup *s, uint32_t label, double rho)
{
    return rho == 0.0 && s->detect->depth > 0 && caster_goes_on(s, label);
}

/* What comes back within the range resolution after the return before is one echo with it: at the mean of the ranges,
 * weighted by what came back, with the surface that sent most, and as wide as the ranges lie apart. The others of its
 * returns are left out of the list. */
static void merge_returns(struct echo_list *l, const struct cast_setup *s, int attributes)
{
    const double separation_m = s->detect->separation_m;
    uint32_t to = 0;
    double last_m = 0.0, most = 0.0,
           spread = 0.0; /* of the echo at hand: its last return, its strongest, sum rho d^2 */
    for (uint32_t i = 0; i < l->n; i++) {
        uint32_t e = to - 1;
        int same = to > 0 && l->pulse[e] == l->pulse[i] && l->rho[e] > 0.0 && l->rho[i] > 0.0 &&
                   l->range_m[i] - last_m <= separation_m; /* not-a-number: no */
        last_m = l->range_m[i];
        if (same) {
            double sum = l->rho[e] + l->rho[i], apart_m = l->range_m[i] - l->range_m[e];
            if (attributes) {
                spread += l->rho[e] * l->rho[i] / sum * apart_m * apart_m;
                l->width_m[e] = (float)beam_echo_width(s->pulse_m, spread / sum);
            }
            l->range_m[e] += (l->range_m[i] - l->range_m[e]) * l->rho[i] / sum;
            if (l->rho[i] > most) {
                l->label[e] = l->label[i];
                l->ghost[e] = l->ghost[i];
            }
            most = fmax(most, l->rho[i]);
            l->rho[e] = sum;
            continue;
        }
        most = l->rho[i];
        spread = 0.0;
        l->pulse[to] = l->pulse[i];
        l->number[to] = to > 0 && l->pulse[to - 1] == l->pulse[i] ? (uint8_t)(l->number[to - 1] + 1) : 0;
        l->range_m[to] = l->range_m[i];
        l->label[to] = l->label[i];
        l->ghost[to] = l->ghost[i];
        l->rho[to] = l->rho[i];
        to++;
    }
    l->n = to;
}

/* How much comes back of each, and what of it can't be told apart. */
static void weigh_returns(const struct cast_setup *s, struct echo_list *l, int attributes)
{
    const struct cast_detect *d = s->detect;
    for (uint32_t i = 0; i < l->n && attributes; i++)
        l->width_m[i] = (float)s->pulse_m;
    if (d->surfaces == NULL) {
        memcpy(l->rho, l->energy, l->n * sizeof *l->rho);
        return;
    }
    surface_return(d->surfaces, l->n, l->label, l->cosine, l->rho);
    for (uint32_t i = 0; i < l->n; i++)
        l->rho[i] *= l->energy[i];
    if (d->depth == 0) return;
    for (uint32_t i = 0; i < l->n; i++)
        if (caster_is_bare(s, l->label[i], l->rho[i])) l->range_m[i] = (double)NAN;
    if (d->separation_m > 0.0) merge_returns(l, s, attributes);
}

/* Ranges of what is not detected become NaN. */
static void find_echoes(struct caster *c, const struct cast_setup *s, const struct schedule_run *run)
{
    const struct cast_detect *d = s->detect;
    struct echo_list *l = &c->list;
    const struct detect_echoes echoes = {.n = l->n,
                                         .key = l->key,
                                         .range_m = l->range_m,
                                         .rho = l->rho,
                                         .amplitude = l->amplitude,
                                         .refl_cdb = l->refl_cdb};
    uint32_t before = count_echoes(l);
    if (d->signal != NULL)
        detect_by_signal(d->signal, &echoes);
    else
        for (uint32_t i = 0; i < l->n; i++)
            l->refl_cdb[i] = LINE_REFL_NONE;
    if (c->attributes) detect_amplitudes(d->signal, &echoes, l->amplitude_cdb);
    if (d->ambiguity != DETECT_AMBIGUITY_NONE)
        detect_zones(d->ambiguity, 1e-9 * ((double)run->ns_quot + (double)run->ns_rem / (double)run->ns_den), d->zones,
                     s->range_min_m, l->n, l->range_m);
    c->counters.faint += before - count_echoes(l);
}

static void add_noise(struct caster *c, const struct cast_setup *s)
{
    const struct cast_detect *d = s->detect;
    struct echo_list *l = &c->list;
    const struct detect_echoes echoes = {.n = l->n, .key = l->key, .range_m = l->range_m, .amplitude = l->amplitude};
    if (d->noise_by_signal)
        detect_range_noise(d->signal, &echoes);
    else if (s->noise_on)
        detect_fixed_noise(s->range_sigma_m, 1e-6 * s->range_sigma_ppm, s->noise_key, l->n, l->key, l->range_m);
    if (d->instrument != NULL) instrument_range(d->instrument, l->n, l->range_m);
}

/* What single rays meet -> c->list. */
static void list_single(struct caster *c, const struct cast_setup *s, const struct origins *from, uint32_t n)
{
    const struct ray_set set = {.dx = c->dx,
                                .dy = c->dy,
                                .dz = c->dz,
                                .range_m = c->range_m,
                                .label = c->label,
                                .hit = c->hit,
                                .cosine = c->cosine,
                                .body = s->detect->surfaces != NULL ? c->body : NULL};
    caster_nearest(c, s, from, &set, n);
    if (s->detect->depth > 0) {
        caster_follow_rays(c, s, from, &set, n);
        caster_list_paths(c, &set, n);
    } else {
        list_hits(c, n);
    }
}

/* Out of the head's range there is no echo. */
static void limit_ranges(struct caster *c, const struct cast_setup *s)
{
    kernel_detect(c->list.range_m, s->range_min_m, s->range_max_m, c->list.n, c->list.echo);
}

uint32_t caster_detected(struct caster *c, const struct cast_setup *s, const struct schedule_run *run,
                         const uint32_t *dt_ns, uint32_t first, uint32_t n, struct line_block *block, uint32_t *at)
{
    struct origins from;
    uint32_t entries;
    if (c->profile != NULL) c->profile->last = c->profile->now();
    caster_aim_bent(c, s, run, dt_ns, first, n, &from);
    if (s->beam != NULL) {
        beam_cast(c, s, &from, n);
        beam_list(c, s, n);
        limit_ranges(c, s);
    } else {
        list_single(c, s, &from, n);
        limit_ranges(c, s);
        weigh_returns(s, &c->list, c->attributes);
    }
    make_keys(&c->list, run->pulse0 + first);
    find_echoes(c, s, run);
    caster_ends(c, CAST_DETECT);
    add_noise(c, s);
    caster_ends(c, CAST_NOISE);
    uint32_t echoes = caster_report(c, s, run, dt_ns, block, *at, &entries);
    *at += entries;
    return echoes;
}
