/* SPDX-License-Identifier: MIT */
/* This file learns how the pulse's echoes look to the detectors. The echoes are measured once, on signals without
 * noise, as a head is adjusted on targets. */
#include "core/waveform/detect_inside.h"

#include <math.h>

#include "core/light.h"
#include "core/vecmath.h"
#include "core/waveform/waveform_inside.h"

enum { LEARN_STEPS = 24, LEARN_ROOM = 2048 };
/* Extent of each tilt, in widths of the pulse. */
static const double learn_tilts[FINDER_SPREADS] = {0.0, 0.25, 0.5, 0.75, 1.0, 1.5, 2.0, 3.0, 4.0, 6.0, 9.0, 14.0};

/* Shares of the peak of h. After its middle a term reaches as far as h is above LEARN_LEAST, which a Gaussian has at 5
 * sigmas. Before its middle a term reaches to the beginning of the table of h, or 5 sigmas far for a Gaussian. In
 * logarithms, values below LEARN_NOTHING count as LEARN_NOTHING. */
#define LEARN_LEAST   4e-6
#define LEARN_NOTHING 1e-12

/* An echo on a grid of its own: y[i] lies `from` + i `step` samples after its centroid. */
struct learn_echo {
    double from, step, y[LEARN_ROOM];
    uint32_t n, top;
};

/* Returns the signal of an echo of amplitude 1, x samples after its centroid. */
static double learn_signal(const struct waveform *waveform, double metre, double extent_m, double x)
{
    const double far_m = 1e6 * metre; /* so far that ranges across the disc are evenly spaced (README, Spread) */
    const struct waveform_return part = {far_m, 1.0, extent_m, extent_m > 0.0 ? WAVEFORM_DISC : WAVEFORM_POINT};
    return waveform_signal(waveform, &part, 1, far_m + x * metre);
}

static void learn_sample(const struct waveform *waveform, double metre, double extent_m, struct learn_echo *echo)
{
    echo->top = 0;
    for (uint32_t i = 0; i < echo->n; i++) {
        echo->y[i] = learn_signal(waveform, metre, extent_m, echo->from + i * echo->step);
        if (echo->y[i] > echo->y[echo->top]) echo->top = i;
    }
}

/* Finds width and rising half maximum of a sampled echo, in its steps. */
static double learn_half(const struct finder *finder, const struct learn_echo *echo, double *rise)
{
    const struct finder_run run = {finder, echo->y, echo->n, NULL, 0.0};
    const struct finder_peak peak = {echo->top, 0, echo->n};
    double side[2];
    (void)finder_half(&run, &peak, echo->y[echo->top], side);
    *rise = side[0];
    return side[1] - side[0];
}

/* Measures peak and width of h, from a first guess of the width: its area over its largest value. (Its value at the
 * centroid would not do: between two humps it may be 0.) */
static void learn_pulse(const struct waveform *waveform, struct finder *finder, struct learn_echo *echo)
{
    const struct waveform_pulse *pulse = &waveform->pulse;
    const double sample_s = waveform_spec_of(waveform)->sample_s, metre = finder->metre;
    double most = 0.0, rise;
    for (uint32_t i = 0; i < pulse->phases * pulse->pitch; i++)
        most = fmax(most, pulse->h[i]);
    double guess = waveform_pulse_area_s(waveform) / sample_s / most;
    for (int i = 0; i < 2; i++) {
        echo->n = LEARN_ROOM;
        echo->step = 16.0 * guess / LEARN_ROOM;
        echo->from = -8.0 * guess;
        learn_sample(waveform, metre, 0.0, echo);
        guess = finder->width = learn_half(finder, echo, &rise) * echo->step;
    }
    finder->peak = echo->y[echo->top];
    finder->middle = (echo->from + rise * echo->step) / finder->width + 0.5;
    const double at = (echo->from + echo->top * echo->step) / finder->width;
    finder->seen = finder->peak > 0.9 * most && at > 1.0 - FINDER_SHAPE_LEAD && at < FINDER_SHAPE_LAG - 1.0;
}

/* Finds where h crosses falling levels on its rising side. The search for each level goes from the peak back in time,
 * to the first place where h is below the level. */
static void learn_leads(struct finder *finder, const struct learn_echo *echo)
{
    uint32_t i = echo->top;
    for (uint32_t k = 0; k < FINDER_LEADS; k++) {
        const double v = k * FINDER_LEAD_STEP, level = exp(-0.5 * v * v) * echo->y[echo->top];
        while (i > 0 && echo->y[i] >= level)
            i--;
        double below = echo->y[i], above = echo->y[i + 1];
        double u = k > 0 && above > level && below < level ? (level - below) / (above - below) : 1.0;
        finder->lead[k] = -(echo->from + (i + u) * echo->step);
    }
}

static void learn_shape(const struct waveform *waveform, struct finder *finder)
{
    const double step = FINDER_SHAPE_STEP * finder->width;
    double m[4] = {0.0};
    for (uint32_t i = 0; i < FINDER_SHAPE; i++) {
        const double x = (i * FINDER_SHAPE_STEP - FINDER_SHAPE_LEAD) * finder->width;
        const double y = learn_signal(waveform, finder->metre, 0.0, x) / finder->peak;
        const double before = learn_signal(waveform, finder->metre, 0.0, x - 0.5 * step) / finder->peak;
        const double after = learn_signal(waveform, finder->metre, 0.0, x + 0.5 * step) / finder->peak;
        finder->shape[i] = y;
        finder->log_shape[i] = log(fmax(y, LEARN_NOTHING));
        finder->log_slope[i] = log(fmax(after, LEARN_NOTHING) / fmax(before, LEARN_NOTHING)) / FINDER_SHAPE_STEP;
        m[0] += y;
        m[2] += y * x * x;
        m[3] += y * x * x * x;
        if (y > LEARN_LEAST) finder->reach[1] = (x / finder->width - finder->middle) * FINDER_FWHM;
    }
    const double *h = finder->shape;
    while (finder->top + 2 < FINDER_SHAPE && (h[finder->top] < h[finder->top + 1] || h[finder->top] < 0.5))
        finder->top++;
    finder->area = waveform_pulse_area_s(waveform) / waveform_spec_of(waveform)->sample_s;
    finder->variance = m[2] / m[0];
    finder->third = m[3] / m[0];
    finder->reach[0] = (FINDER_SHAPE_LEAD + finder->middle) * FINDER_FWHM;
    if (finder->gaussian) finder->reach[0] = finder->reach[1] = 5.0;
}

/* Logarithms are interpolated: flanks of saturated pulses are far below the peak. */
double finder_value(const struct finder *finder, double d)
{
    if (finder->gaussian) return exp(-0.5 * d * d);
    const double widths = finder->middle + d * (1.0 / FINDER_FWHM), value = finder_table(finder->log_shape, widths);
    return value < 0.0 ? vec_exp(value) : finder_table(finder->shape, widths);
}

double finder_fall(const struct finder *finder, double d, double value)
{
    if (finder->gaussian) return d * value;
    return finder_table(finder->log_slope, finder->middle + d * (1.0 / FINDER_FWHM)) * (-1.0 / FINDER_FWHM) * value;
}

double finder_lead(const struct finder *finder, double part)
{
    double v = part < 1.0 ? sqrt(-2.0 * log(part)) / FINDER_LEAD_STEP : 0.0;
    v = fmin(v, FINDER_LEADS - 1.001);
    uint32_t k = (uint32_t)v;
    return finder->lead[k] + (v - k) * (finder->lead[k + 1] - finder->lead[k]);
}

/* Returns the RMS that a term leaves near its middle. */
static double learn_rest(const struct finder *finder, const struct learn_echo *echo, const struct finder_term *g)
{
    double sum = 0.0, n = 0.0;
    for (uint32_t i = 0; i < echo->n; i++) {
        const double d = (i - g->at) / g->sigma, rest = echo->y[i] - g->peak * finder_value(finder, d);
        if (fabs(d) > FINDER_NEAR) continue;
        sum += rest * rest;
        n += 1.0;
    }
    return sqrt(sum / fmax(1.0, n));
}

/* Fits the term of an echo, and measures how far the echo differs from it. Where no term fits, as with some pulses of
 * several humps, the term follows from the echo's half maxima. */
static void learn_fit(const struct finder *finder, const struct learn_echo *echo, struct finder_spread *spread)
{
    const struct finder_run run = {finder, echo->y, echo->n, NULL, 0.0};
    const struct finder_peak peak = {echo->top, 0, echo->n};
    const double top = echo->y[echo->top];
    struct finder_term g;
    double rms = finder_fit_near(&run, &peak, &g), rise;
    const double width = learn_half(finder, echo, &rise);
    if (rms < 0.0) {
        g = (struct finder_term){rise + 0.5 * width, width / FINDER_FWHM, top};
        rms = learn_rest(finder, echo, &g);
    }
    spread->sigma = g.sigma * echo->step;
    spread->lag = echo->from + g.at * echo->step;
    spread->gain = top / g.peak;
    spread->misfit = rms / top;
    spread->width = width * echo->step;
    spread->half_lead = -(echo->from + rise * echo->step);
    spread->tail = 0.0;
    for (uint32_t i = 0; i < echo->n; i++) {
        double d = (i - g.at) / g.sigma, rest = echo->y[i] - g.peak * finder_value(finder, d);
        if (fabs(d) > FINDER_NEAR) spread->tail = fmax(spread->tail, rest / top);
    }
}

void finder_learn(const struct waveform *waveform, struct finder *finder)
{
    const struct waveform_spec *spec = waveform_spec_of(waveform);
    const double most = (double)((1U << spec->bits) - 1);
    struct learn_echo echo;
    finder->metre = 0.5 * LIGHT_SPEED_M_S * spec->sample_s;
    finder->signal = spec->full_scale / (most - spec->baseline_counts);
    finder->noise = 0.0; /* the signals measured below have none */
    finder->gaussian = spec->shape == WAVEFORM_GAUSSIAN;
    finder->limit = INFINITY;
    finder->blind = spec->saturation > 0.0 ? (uint32_t)waveform->dead : 0;
    learn_pulse(waveform, finder, &echo);
    if (!finder->seen) return;
    learn_leads(finder, &echo);
    learn_shape(waveform, finder);
    for (uint32_t k = 0; k < FINDER_SPREADS; k++) {
        const double extent = learn_tilts[k] * finder->width;
        echo.step = finder->width * fmax(1.0, 0.5 * learn_tilts[k]) / LEARN_STEPS;
        echo.from = -(extent + 3.0 * finder->width);
        echo.n = (uint32_t)((2.0 * extent + 8.0 * finder->width) / echo.step);
        learn_sample(waveform, finder->metre, extent * finder->metre, &echo);
        learn_fit(finder, &echo, &finder->spread[k]);
    }
    finder->noise = sqrt(spec->noise * spec->noise + finder->signal * finder->signal / 12.0);
    finder->limit = (most - spec->baseline_counts - 0.5) * finder->signal;
    /* Noise is added after the receiver's limit. It lowers one limited sample in 3 million by more than 5 sigmas. */
    if (spec->saturation > 0.0) finder->limit = fmin(finder->limit, spec->saturation - 5.0 * finder->noise);
}

/* Interpolates `spread` between the tilts k and k + 1, at share u of the way. */
static void learn_between(const struct finder *finder, uint32_t k, double u, struct finder_spread *spread)
{
    const struct finder_spread *a = &finder->spread[k], *b = a + 1;
    *spread = (struct finder_spread){
        .sigma = a->sigma + u * (b->sigma - a->sigma),
        .lag = a->lag + u * (b->lag - a->lag),
        .gain = a->gain + u * (b->gain - a->gain),
        .width = a->width + u * (b->width - a->width),
        .half_lead = a->half_lead + u * (b->half_lead - a->half_lead),
        .misfit = fmax(a->misfit, b->misfit),
        .tail = fmax(a->tail, b->tail),
    };
}

/* Before the first tilt and after the last one, sigma, width and half_lead change in proportion. */
static void learn_stretch(const struct finder_spread *end, double ratio, struct finder_spread *spread)
{
    *spread = *end;
    spread->sigma *= ratio;
    spread->width *= ratio;
    spread->half_lead *= ratio;
}

static double learn_key(const struct finder_spread *spread, enum finder_key key)
{
    return key == FINDER_SIGMA ? spread->sigma : spread->width;
}

void finder_find(const struct finder *finder, enum finder_key key, double value, struct finder_spread *spread)
{
    const struct finder_spread *s = finder->spread, *end = &s[FINDER_SPREADS - 1];
    const double least = learn_key(s, key);
    uint32_t k = 0;
    if (value <= least || value >= learn_key(end, key)) {
        const struct finder_spread *near = value <= least ? s : end;
        learn_stretch(near, value / learn_key(near, key), spread);
        return;
    }
    while (value > learn_key(&s[k + 1], key))
        k++;
    const double before = learn_key(&s[k], key);
    learn_between(finder, k, (value - before) / (learn_key(&s[k + 1], key) - before), spread);
}
