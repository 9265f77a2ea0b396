/* SPDX-License-Identifier: MIT */
/* This file has the samples of one pulse: how far its returns reach, which part of that is kept, and which counts
 * the digitiser makes of it. */
#include <string.h>

#include "core/rng.h"
#include "core/vecmath.h"
#include "core/waveform/waveform_inside.h"

/* Samples begin .. end of the pulse's grid. */
struct span {
    int64_t begin, end;
};

struct sampling {
    const struct waveform *w;
    const struct waveform_return *returns;
    uint32_t n;
    uint64_t key;
    struct waveform_record *record;
    int64_t kept_end; /* a window that was cut goes on up to here */
    int64_t dead_end; /* samples before it are in a dead time */
    int limited;      /* the sample before is saturated */
    double signal[WAVEFORM_MAX_SAMPLES];
};

/* The windows found in a piece of a stretch. */
struct found {
    struct span window[WAVEFORM_MAX_WINDOWS];
    uint32_t n;
};

/* ---- where there is light */

/* Returns the samples that return i reaches, and those kept before and after it. Number n is the fixed window, if
 * there is one. */
static struct span span_of(const struct sampling *s, uint32_t i)
{
    const struct waveform *w = s->w;
    if (i == s->n) return (struct span){w->gate_begin, w->gate_end};
    const struct waveform_return *r = &s->returns[i];
    const double centre = r->range_m * w->samples_1_m, reach = waveform_reach(w, r);
    const double from = centre - reach - w->pulse.lead - (double)w->before;
    /* nothing is sampled before the emission */
    return (struct span){from > 0.0 ? (int64_t)from : 0, (int64_t)(centre + reach + w->pulse.lag) + w->after + 2};
}

/* Finds the first stretch from `from` on that returns cover without a gap. Returns 0 if there is none. Light that
 * begins before `from` is in an earlier stretch. */
static int next_stretch(const struct sampling *s, int64_t from, struct span *stretch)
{
    const uint32_t n = s->n + (s->w->gate_end > 0);
    int grown = 1;
    stretch->begin = INT64_MAX;
    for (uint32_t i = 0; i < n; i++) {
        struct span span = span_of(s, i);
        if (span.begin >= from && span.begin < stretch->begin && span.end > span.begin) *stretch = span;
    }
    if (stretch->begin == INT64_MAX) return 0;
    while (grown) {
        grown = 0;
        for (uint32_t i = 0; i < n; i++) {
            struct span span = span_of(s, i);
            if (span.begin < stretch->begin || span.begin > stretch->end || span.end <= stretch->end) continue;
            stretch->end = span.end;
            grown = 1;
        }
    }
    return 1;
}

static void sum_returns(struct sampling *s, struct span piece)
{
    const uint32_t n = (uint32_t)(piece.end - piece.begin);
    memset(s->signal, 0, n * sizeof *s->signal);
    for (uint32_t i = 0; i < s->n; i++)
        waveform_add(s->w, &s->returns[i], s->returns[i].range_m * s->w->samples_1_m - (double)piece.begin, n,
                     s->signal);
}

/* ---- windows */

static void found_add(struct sampling *s, struct found *found, struct span window)
{
    if (window.end <= window.begin) return;
    if (found->n == WAVEFORM_MAX_WINDOWS)
        s->record->n_left_out += (uint32_t)(window.end - window.begin);
    else
        found->window[found->n++] = window;
}

/* Finds the windows of a piece of a stretch. Returns where the next piece begins. If this piece cuts a window, the
 * next piece begins where that window begins, so that it contains the whole window. Otherwise the next piece begins
 * w->before samples before the end of this one, since the window of a later signal can begin there. A window with more
 * samples than a piece is cut. */
static int64_t find_windows(struct sampling *s, struct span piece, int64_t stretch_end, struct found *found)
{
    const struct waveform *w = s->w;
    const double keep = w->spec.keep;
    struct span open = {piece.begin, s->kept_end > piece.begin ? s->kept_end : piece.begin};
    for (int64_t k = piece.begin; k < piece.end; k++) {
        if (s->signal[k - piece.begin] < keep) continue;
        struct span at = {k - w->before < piece.begin ? piece.begin : k - w->before, k + w->after + 1};
        if (at.begin > open.end) {
            found_add(s, found, open);
            open.begin = at.begin;
        }
        open.end = at.end;
    }
    if (piece.end == stretch_end || open.end + w->before < piece.end) {
        found_add(s, found, open);
        return piece.end == stretch_end ? stretch_end : piece.end - w->before;
    }
    if (open.begin > piece.begin) return open.begin;
    s->kept_end = open.end;
    if (open.end > piece.end) open.end = piece.end;
    found_add(s, found, open);
    return open.end;
}

/* Does the same for a fixed window. To keep the window whole, the piece after one that cuts it begins at the window. */
static int64_t find_gate(struct sampling *s, struct span piece, struct found *found)
{
    const struct span gate = {s->w->gate_begin, s->w->gate_end};
    if (gate.end <= piece.begin || gate.begin >= piece.end) return piece.end;
    if (gate.end > piece.end) return gate.begin;
    found_add(s, found, gate);
    return piece.end;
}

/* ---- the receiver and the digitiser */

/* Limits samples begin .. end of the piece. Saturated samples that follow each other are one saturation, and the dead
 * time counts from the last of them. */
static void limit_signal(struct sampling *s, struct span piece, int64_t end)
{
    const double most = s->w->spec.saturation;
    for (int64_t k = piece.begin; k < end; k++) {
        double *signal = &s->signal[k - piece.begin];
        if (k < s->dead_end && !s->limited) {
            *signal = 0.0;
        } else if (*signal >= most) {
            *signal = most;
            s->limited = 1;
            s->dead_end = k + 1 + s->w->dead;
        } else {
            s->limited = 0;
            if (k < s->dead_end) *signal = 0.0;
        }
    }
}

VEC_INLINE uint16_t count_of(const struct waveform_digits *d, double signal, double noise)
{
    uint64_t bits;
    double x = d->baseline + d->counts_1 * ((signal < d->most ? signal : d->most) + noise);
    x = x > 0.0 ? x : 0.0;
    vec_round(x < d->top ? x : d->top, &bits);
    return (uint16_t)bits;
}

VEC_CLONES
static void digitise(const struct waveform_digits *d, const double *restrict signal, uint32_t n,
                     uint16_t *restrict count)
{
    const struct waveform_digits digits = *d;
    for (uint32_t i = 0; i < n; i++)
        count[i] = count_of(&digits, signal[i], 0.0);
}

/* This is the generator of core/rng.h in its plain form. The pulse's key is random already, so one round is enough. */
VEC_CLONES
static void digitise_noisy(const struct waveform_digits *d, const double *restrict signal, uint32_t n, uint64_t key,
                           uint64_t first, uint16_t *restrict count)
{
    const struct waveform_digits digits = *d;
    for (uint32_t i = 0; i < n; i++) {
        double noise = digits.noise * rng_normal_of(rng_mix(key + (first + i) * 0x9e3779b97f4a7c15ULL));
        count[i] = count_of(&digits, signal[i], noise);
    }
}

static void write_window(struct sampling *s, struct span piece, struct span window)
{
    struct waveform_record *record = s->record;
    const uint32_t n = (uint32_t)(window.end - window.begin);
    if (record->n_windows == WAVEFORM_MAX_WINDOWS || n > record->capacity - record->n_samples) {
        record->n_left_out += n;
        return;
    }
    const double *signal = s->signal + (window.begin - piece.begin);
    uint16_t *count = record->sample + record->n_samples;
    if (s->w->digits.noise > 0.0)
        digitise_noisy(&s->w->digits, signal, n, s->key, (uint64_t)window.begin, count);
    else
        digitise(&s->w->digits, signal, n, count);
    record->window[record->n_windows++] = (struct waveform_window){(uint32_t)window.begin, n, record->n_samples};
    record->n_samples += n;
}

static void sample_stretch(struct sampling *s, struct span stretch)
{
    for (int64_t at = stretch.begin, next; at < stretch.end; at = next) {
        struct found found = {.n = 0};
        struct span piece = {at, stretch.end - at > WAVEFORM_MAX_SAMPLES ? at + WAVEFORM_MAX_SAMPLES : stretch.end};
        sum_returns(s, piece);
        next = s->w->gate_end > 0 ? find_gate(s, piece, &found) : find_windows(s, piece, stretch.end, &found);
        if (s->w->dead > 0) limit_signal(s, piece, next);
        for (uint32_t i = 0; i < found.n; i++)
            write_window(s, piece, found.window[i]);
    }
}

void waveform_sample(const struct waveform *w, uint64_t scan_key, uint64_t pulse, const struct waveform_return *returns,
                     uint32_t n, struct waveform_record *record)
{
    struct sampling s;
    struct span stretch = {0, 0};
    s.w = w;
    s.returns = returns;
    s.n = n;
    s.key = rng_u64(w->key ^ scan_key, pulse);
    s.record = record;
    s.kept_end = 0;
    s.dead_end = 0;
    s.limited = 0;
    record->n_windows = record->n_samples = record->n_left_out = 0;
    while (next_stretch(&s, stretch.end, &stretch)) {
        int gated_out = w->gate_end > 0 && (stretch.end <= w->gate_begin || stretch.begin >= w->gate_end);
        if (!gated_out || w->dead > 0) sample_stretch(&s, stretch);
    }
}
