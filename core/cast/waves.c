/* SPDX-License-Identifier: MIT */
/* This stage samples the light that comes back of each pulse, over time. The returns are taken before merging:
 *
 *     one ray for the whole footprint    a disc on the plane that it hits: the closed form
 *     parts of a footprint that is cut   a bell (Gaussian) each, as wide as the part is deep
 *     sub-rays                           a bell each, as wide as the ray's share of the footprint is deep; where there
 *                                        are many, neighbours are joined first
 *
 * Echoes that are found in the samples have the noise of the samples; no other noise is added. */
#include "core/cast/waves.h"

#include <math.h>
#include <string.h>

#include "core/bytes.h"
#include "core/cast/caster.h"
#include "core/cast/kernels_points.h"
#include "core/cast/tripod.h"
#include "core/light.h"

void waves_begin(struct caster *c, const struct chunk *k)
{
    struct wave_work *w = c->waves;
    w->n_parts = 0;
    for (uint32_t i = 0; i < k->n; i++)
        w->of[i].own = 0;
}

/* ---- returns */

/* Returns half the depth of a footprint on a plane. At grazing incidence it is limited as in beam_plane_means. */
static double disc_extent(const struct cast_waves *waves, double range_m, double cosine)
{
    const double tan_i = sqrt(fmax(0.0, 1.0 / fmax(cosine * cosine, 1e-12) - 1.0));
    return fmin(beam_radius(waves->beam, range_m) * tan_i, 0.5 * range_m);
}

static int is_in_range(const struct cast_setup *s, double range_m)
{
    return range_m >= s->range_min_m && range_m <= s->range_max_m; /* not for NaN */
}

static uint32_t parts_begin(struct wave_work *w, uint32_t pulse)
{
    w->of[pulse].own = 1;
    w->of[pulse].first = w->n_parts;
    w->of[pulse].n = 0;
    return w->n_parts;
}

static void parts_end(struct wave_work *w, uint32_t pulse, uint32_t n)
{
    w->of[pulse].n = n;
    w->n_parts += n;
}

/* Returns one part for returns that lie close together. The part keeps their power, mean and variance. */
static struct wave_part join_returns(const struct beam_return *r, uint32_t n)
{
    double back = 0.0, first = 0.0, second = 0.0;
    uint32_t most = 0;
    for (uint32_t i = 0; i < n; i++) {
        const double d = r[i].range_m - r[0].range_m, sigma = (double)r[i].sigma_m;
        back += r[i].back;
        first += r[i].back * d;
        second += r[i].back * (d * d + sigma * sigma);
        if (r[i].back > r[most].back) most = i;
    }
    const double mean = first / back, sigma_m = sqrt(fmax(0.0, second / back - mean * mean));
    return (struct wave_part){.range_m = r[0].range_m + mean,
                              .back = back,
                              .extent_m = sigma_m,
                              .label = r[most].label,
                              .colour = r[most].colour,
                              .spread = sigma_m > 0.0 ? WAVEFORM_BELL : WAVEFORM_POINT};
}

/* Joins sorted returns that are within apart_m of the first one of their group. Returns the number of groups; if
 * there are too many, WAVES_PARTS + 1. */
static uint32_t join_groups(const struct beam_return *r, uint32_t n, double apart_m, struct wave_part *part)
{
    uint32_t found = 0;
    for (uint32_t i = 0, end; i < n; i = end) {
        for (end = i + 1; end < n && r[end].range_m - r[i].range_m <= apart_m;)
            end++;
        if (found == WAVES_PARTS) return WAVES_PARTS + 1;
        part[found++] = join_returns(r + i, end - i);
    }
    return found;
}

/* With this many returns or fewer, none are joined. */
enum { FEW = 16 };

/* Two returns d apart that are joined into one lose a third moment of at most 0.096 d^3. Here d, as a time, is a
 * sixteenth of the pulse's integral over time (in s). So d is about a fifteenth of the pulse's width. The signal
 * changes by 1e-4 of its peak: less than half a count of 12 bits. */
static double least_apart_m(const struct cast_waves *waves)
{
    return 0.5 * LIGHT_SPEED_M_S * waveform_pulse_area_s(waves->waveform) / 16.0;
}

static uint32_t keep_visible(const struct cast_setup *s, struct beam_return *r, uint32_t n)
{
    uint32_t to = 0;
    for (uint32_t i = 0; i < n; i++)
        if (r[i].back > 0.0 && is_in_range(s, r[i].range_m)) r[to++] = r[i];
    return to;
}

void waves_take_returns(struct caster *c, const struct chunk *k, uint32_t pulse, struct beam_return *r, uint32_t n)
{
    struct wave_work *w = c->waves;
    struct wave_part *part = &w->part[parts_begin(w, pulse)];
    double apart_m = least_apart_m(k->s->waves);
    n = keep_visible(k->s, r, n);
    if (n > FEW) beam_sort(r, n);
    uint32_t found = n > FEW ? WAVES_PARTS + 1 : join_groups(r, n, -(double)INFINITY, part);
    for (; found > WAVES_PARTS; apart_m *= 2.0) /* too many, as among branches: coarser groups keep all power */
        found = join_groups(r, n, apart_m, part);
    parts_end(w, pulse, found);
}

/* Takes entry i of the list as a return. Returns whether any light comes back. */
static int take_entry(const struct caster *c, const struct chunk *k, uint32_t i, struct wave_part *part)
{
    const struct echo_list *l = &c->list;
    if (!is_in_range(k->s, l->range_m[i]) || !(l->rho[i] > 0.0)) return 0;
    *part = (struct wave_part){.range_m = l->range_m[i],
                               .back = l->rho[i],
                               .extent_m = disc_extent(k->s->waves, l->range_m[i], l->cosine[i]),
                               .label = l->label[i],
                               .colour = k->texels ? l->colour[i] : 0,
                               .spread = WAVEFORM_DISC};
    return 1;
}

void waves_take_paths(struct caster *c, const struct chunk *k)
{
    struct wave_work *w = c->waves;
    for (uint32_t g = 0; g < c->list.n_secondary; g++) {
        const struct secondary *f = &c->list.secondary[g];
        struct wave_part *part = &w->part[parts_begin(w, f->pulse)];
        uint32_t n = (uint32_t)take_entry(c, k, f->pulse, part);
        for (uint32_t i = f->at; i < f->at + f->n; i++)
            n += (uint32_t)take_entry(c, k, i, part + n);
        parts_end(w, f->pulse, n);
    }
}

/* ---- samples */

/* This has the returns of the pulse at hand. */
struct wave_pulse {
    uint32_t number; /* in the chunk */
    const struct wave_part *part;
    uint32_t n;
    struct wave_part one; /* of a pulse without returns of its own */
};

static void find_parts(const struct caster *c, const struct chunk *k, uint32_t i, struct wave_pulse *p)
{
    const struct wave_work *w = c->waves;
    const struct cast_tripod *tripod = k->s->tripod;
    p->number = i;
    p->part = w->of[i].own ? &w->part[w->of[i].first] : &p->one;
    p->n = w->of[i].own ? w->of[i].n : (uint32_t)take_entry(c, k, i, &p->one);
    if (tripod != NULL && caster_is_hidden(tripod, &VEC3_IN(c->d, 0), i)) p->n = 0;
}

/* Samples have the range errors of the instrument, since the digitiser's clock is that of the points. */
static void sample_pulse(struct caster *c, const struct chunk *k, const struct wave_pulse *p)
{
    const struct cast_setup *s = k->s;
    const struct waveform_spec *spec = waveform_spec_of(k->s->waves->waveform);
    const double share = s->disturbance != NULL ? s->disturbance->share : 1.0;
    struct wave_work *w = c->waves;
    w->record.sample = w->sample;
    w->record.capacity = WAVES_ROOM;
    w->record.n_windows = w->record.n_samples = w->record.n_left_out = 0;
    if (p->n == 0 && !(spec->near_m < spec->far_m)) return; /* nothing is kept */
    for (uint32_t i = 0; i < p->n; i++) {
        const struct wave_part *part = &p->part[i];
        double range_m = part->range_m;
        const double amplitude = share * detect_amplitude(s->detect->signal, range_m, part->back);
        if (s->detect->instrument != NULL) instrument_range(s->detect->instrument, 1, &range_m);
        w->returns[i] = (struct waveform_return){range_m, amplitude, part->extent_m, part->spread};
    }
    waveform_sample(k->s->waves->waveform, s->scan_key, k->pulse0 + p->number, w->returns, p->n, &w->record);
    c->counters.lost_samples += w->record.n_left_out;
}

/* Copies the windows of the pulse at hand into the block. Whole windows that find no room are counted. */
static void keep_windows(struct caster *c, const struct chunk *k, uint32_t pulse)
{
    const struct waveform_record *from = &c->waves->record;
    struct line_waves *to = k->block->waves;
    to->n_left_out += from->n_left_out;
    for (uint32_t i = 0; i < from->n_windows; i++) {
        const struct waveform_window *window = &from->window[i];
        if (to->n == to->capacity || window->n > to->sample_capacity - to->n_samples) {
            to->n_left_out += window->n;
            c->counters.lost_samples += window->n;
            continue;
        }
        to->wave[to->n++] = (struct line_wave){.pulse = k->first + pulse,
                                               .dt_ns = k->dt_ns[pulse],
                                               .first = window->first,
                                               .n = window->n,
                                               .at = to->n_samples};
        memcpy(to->sample + to->n_samples, from->sample + window->at, window->n * sizeof *to->sample);
        to->n_samples += window->n;
    }
}

/* ---- the beams of windows */

enum { BEAMS = 128 }; /* windows at a time */

/* Computes directions in a CRS that is no rotation of the scene, from two positions a metre apart. */
static void bend_beams(const struct caster *c, const struct chunk *k, struct line_wave *wave, uint32_t n)
{
    const struct cast_setup *s = k->s;
    const struct echo_list *l = &c->list;
    const double step_m = 0.5 * LIGHT_SPEED_M_S * waveform_spec_of(k->s->waves->waveform)->sample_s;
    double at[3][2 * BEAMS];
    for (uint32_t i = 0; i < 2 * n; i++) {
        const uint32_t pulse = wave[i % n].pulse - k->first;
        const double e[3] = VEC3_AT(l->e, pulse), range_m = wave[i % n].first * step_m + (i < n ? 0.0 : 1.0);
        const double from[3] = {s->n_knots != 0 ? l->p.x[pulse] - s->station_m[0] : 0.0,
                                s->n_knots != 0 ? l->p.y[pulse] - s->station_m[1] : 0.0,
                                s->n_knots != 0 ? l->p.z[pulse] - s->station_m[2] : 0.0};
        for (int a = 0; a < 3; a++)
            at[a][i] = from[a] + range_m * e[a];
    }
    georef_forward(s->georef, 2 * n, (struct vec3_in){at[0], at[1], at[2]}, (struct vec3_out){at[0], at[1], at[2]});
    for (uint32_t i = 0; i < n; i++) {
        wave[i].a = float_bits((float)(at[0][n + i] - at[0][i]));
        wave[i].b = float_bits((float)(at[1][n + i] - at[1][i]));
        wave[i].c = float_bits((float)(at[2][n + i] - at[2][i]));
    }
}

/* Sets the beams of the block's windows from `first` on, in the layout of its points: directions in the CRS, or counts
 * of the encoders. */
static void set_beams(const struct caster *c, const struct chunk *k, uint32_t first)
{
    const struct cast_setup *s = k->s;
    const struct echo_list *l = &c->list;
    struct line_waves *waves = k->block->waves;
    for (uint32_t i = first, n; i < waves->n && s->layout == LINE_GEO && !k->linear; i += n) {
        n = waves->n - i < BEAMS ? waves->n - i : BEAMS;
        bend_beams(c, k, waves->wave + i, n);
    }
    if (s->layout == LINE_GEO && !k->linear) return;
    for (uint32_t i = first; i < waves->n; i++) {
        struct line_wave *wave = &waves->wave[i];
        const uint32_t pulse = wave->pulse - k->first;
        if (s->layout == LINE_GEO) {
            wave->a = float_bits((float)l->e.x[pulse]);
            wave->b = float_bits((float)l->e.y[pulse]);
            wave->c = float_bits((float)l->e.z[pulse]);
        } else {
            wave->b = instrument_encoder_count(l->mirror_turn[pulse], s->mirror_counts);
            wave->c = instrument_encoder_count(l->pan_turn[pulse], s->pan_counts);
        }
    }
}

/* ---- echoes that are found in the samples */

/* The list's echoes are counted and taken away; each pulse keeps its place. */
static void clear_list(struct caster *c, const struct chunk *k)
{
    struct echo_list *l = &c->list;
    uint8_t *merged = c->waves->merged;
    for (uint32_t i = 0; i < k->n; i++)
        merged[i] = (uint8_t)!isnan(l->range_m[i]);
    for (uint32_t g = 0; g < l->n_secondary; g++)
        for (uint32_t i = l->secondary[g].at; i < l->secondary[g].at + l->secondary[g].n; i++)
            merged[l->secondary[g].pulse] += (uint8_t)!isnan(l->range_m[i]);
    l->n = k->n;
    l->n_secondary = 0;
}

/* Returns the part from which an echo comes. It is the strongest of the parts that are within half the echo's width.
 * Without such a part it is the nearest one, if that is less than two widths away. NULL: the echo is noise. */
static const struct wave_part *part_of(const struct caster *c, const struct wave_pulse *p,
                                       const struct waveform_echo *echo)
{
    const struct waveform_return *r = c->waves->returns;
    const double half_m = 0.25 * LIGHT_SPEED_M_S * echo->width_s;
    uint32_t best = p->n, nearest = 0;
    for (uint32_t i = 0; i < p->n; i++) {
        const double away_m = fabs(r[i].range_m - echo->range_m);
        if (away_m <= half_m && (best == p->n || r[i].amplitude > r[best].amplitude)) best = i;
        if (away_m < fabs(r[nearest].range_m - echo->range_m)) nearest = i;
    }
    if (best < p->n) return &p->part[best];
    return p->n > 0 && fabs(r[nearest].range_m - echo->range_m) < 4.0 * half_m ? &p->part[nearest] : NULL;
}

static int16_t as_cdb(double ratio)
{
    return (int16_t)lrint(fmin(32767.0, fmax(-32767.0, 1000.0 * log10(ratio))));
}

static void put_echo(struct caster *c, const struct chunk *k, uint32_t at, const struct waveform_echo *echo,
                     const struct wave_part *part)
{
    struct echo_list *l = &c->list;
    const double deviation = 1000.0 * echo->deviation;
    l->range_m[at] = echo->range_m;
    l->label[at] = part != NULL ? part->label : (uint32_t)LINE_LABEL_NONE;
    l->amplitude[at] = echo->amplitude;
    l->refl_cdb[at] = as_cdb(detect_reflectance(k->s->detect->signal, echo->range_m, echo->amplitude));
    l->amplitude_cdb[at] = as_cdb(echo->amplitude);
    l->width_m[at] = (float)(0.5 * LIGHT_SPEED_M_S * echo->width_s);
    l->deviation[at] = (uint16_t)(deviation < 65535.0 ? lrint(deviation) : 65535); /* NaN: 65535 */
    if (k->texels) l->colour[at] = part != NULL ? part->colour : 0;
}

/* Takes away echoes beyond the head's ranges. Returns how many are left. */
static uint32_t keep_ranges(const struct cast_setup *s, struct waveform_echo *echo, uint32_t n)
{
    uint32_t kept = 0;
    for (uint32_t j = 0; j < n; j++)
        if (is_in_range(s, echo[j].range_m)) echo[kept++] = echo[j];
    return kept;
}

static void find_echoes(struct caster *c, const struct chunk *k, const struct wave_pulse *p)
{
    struct echo_list *l = &c->list;
    const uint32_t i = p->number;
    struct waveform_echo echo[LINE_MAX_ECHOES];
    uint32_t crowded = 0;
    /* Echoes beyond the head's max_echoes are dropped later: so one out of range does not take another's place. */
    const uint32_t found = waveform_detect(k->s->waves->waveform, k->s->waves->detector, &c->waves->record, echo,
                                           LINE_MAX_ECHOES, &crowded);
    const uint32_t n = keep_ranges(k->s, echo, found);
    const uint32_t rest = n > 1 ? echoes_secondary(l, i, n - 1) : 0, all = n + crowded;
    c->counters.crowded += crowded;
    const uint32_t missed = c->waves->merged[i] > all ? c->waves->merged[i] - all : 0, outside = found - n;
    /* An echo out of range is among the missed, too. Such an echo counts once. */
    c->counters.faint += missed > outside ? missed : outside;
    if (n == 0) l->range_m[i] = (double)NAN;
    for (uint32_t j = 0; j < n; j++) {
        const uint32_t at = j == 0 ? i : rest + j - 1;
        put_echo(c, k, at, &echo[j], part_of(c, p, &echo[j]));
        l->number[at] = (uint8_t)j;
    }
}

void caster_waves(struct caster *c, const struct chunk *k)
{
    const int sends = k->block->waves != NULL, finds = k->s->waves->finds;
    const uint32_t first = sends ? k->block->waves->n : 0;
    if (finds) clear_list(c, k);
    for (uint32_t i = 0; i < k->n; i++) {
        struct wave_pulse pulse;
        find_parts(c, k, i, &pulse);
        sample_pulse(c, k, &pulse);
        if (sends) keep_windows(c, k, i);
        if (finds) find_echoes(c, k, &pulse);
    }
    if (sends) set_beams(c, k, first);
}
