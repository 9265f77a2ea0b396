/* SPDX-License-Identifier: MIT */
/* Fits one term (a Gaussian, or h stretched; detect_inside.h) to the samples of one maximum. Nearly all echoes are
 * found in this way, so it has to be cheap.
 *
 * The half maxima give a first term. Gauss's and Newton's steps then minimise the squares of the residual within
 * FINDER_NEAR sigma of its centre. Samples further out would lower the variance of the range by 0.6 % (the part of
 * the integral of x^2 exp(-x^2) beyond 2.5), but they bring in neighbours. Samples are evenly spaced, so
 * a Gaussian needs no exp after its first sample: from sample to sample the value is multiplied by a ratio, and the
 * ratio by a constant factor. */
#include "core/waveform/detect_inside.h"

#include <math.h>

enum { FIT_STEPS = 24 };
/* The fit has come to its end where another step would lower the sum of squares by this part of a sample's variance. */
#define FIT_ENOUGH 0.01

/* Sums over the samples: products of two derivatives (h), of a derivative and the rest (r), and rest^2. */
struct fit_sums {
    double h[6], r[3], rest2; /* h: 00, 01, 02, 11, 12, 22 */
    uint32_t n;
};

static inline void fit_add(struct fit_sums *sums, double rest, double a, double b, double c)
{
    sums->h[0] += a * a;
    sums->h[1] += a * b;
    sums->h[2] += a * c;
    sums->h[3] += b * b;
    sums->h[4] += b * c;
    sums->h[5] += c * c;
    sums->r[0] += rest * a;
    sums->r[1] += rest * b;
    sums->r[2] += rest * c;
    sums->rest2 += rest * rest;
}

/* Sums products of a term's derivatives, by log peak, by its middle in sigmas and by log sigma. The term has peak 1. */
static void fit_sum(const struct finder_run *run, const struct finder_term *g, uint32_t lo, uint32_t hi,
                    struct fit_sums *sums)
{
    const double step = 1.0 / g->sigma;
    double d = ((double)lo - g->at) * step;
    *sums = (struct fit_sums){.n = hi - lo + 1};
    if (!run->finder->gaussian) {
        for (uint32_t i = lo; i <= hi; i++, d += step) {
            /* This near to its peak, h itself is interpolated. Only far flanks need its logarithm (finder_value). */
            const double widths = run->finder->middle + d * (1.0 / FINDER_FWHM);
            const double value = finder_table(run->finder->shape, widths);
            const double fall = finder_table(run->finder->log_slope, widths) * (-1.0 / FINDER_FWHM) * value;
            fit_add(sums, run->y[i] - g->peak * value, value, fall, fall * d);
        }
        return;
    }
    double value = exp(-0.5 * d * d), ratio = exp(-step * (d + 0.5 * step)), change = exp(-step * step);
    for (uint32_t i = lo; i <= hi; i++, d += step) {
        const double fall = value * d;
        fit_add(sums, run->y[i] - g->peak * value, value, fall, fall * d);
        value *= ratio;
        ratio *= change;
    }
}

/* Finds the step by Cramer's rule. Returns by how much it lowers the sum of squares; below 0 if the samples don't
 * determine it. */
static double fit_step(const struct fit_sums *m, double peak, double p[3])
{
    const double *h = m->h, *r = m->r;
    double c0 = h[3] * h[5] - h[4] * h[4], c1 = h[2] * h[4] - h[1] * h[5], c2 = h[1] * h[4] - h[2] * h[3];
    double det = h[0] * c0 + h[1] * c1 + h[2] * c2;
    if (!(det > 1e-9 * h[0] * h[3] * h[5])) return -1.0;
    double c3 = h[0] * h[5] - h[2] * h[2], c4 = h[1] * h[2] - h[0] * h[4], c5 = h[0] * h[3] - h[1] * h[1];
    double by = 1.0 / (det * peak);
    p[0] = by * (c0 * r[0] + c1 * r[1] + c2 * r[2]);
    p[1] = by * (c1 * r[0] + c3 * r[1] + c4 * r[2]);
    p[2] = by * (c2 * r[0] + c4 * r[1] + c5 * r[2]);
    return peak * (p[0] * r[0] + p[1] * r[1] + p[2] * r[2]);
}

/* Chooses the samples within FINDER_NEAR sigma, at least 3. Returns 0 if there are fewer, or if the peak's samples
 * don't reach both flanks. */
static int fit_samples(const struct finder_peak *peak, const struct finder_term *g, uint32_t *lo, uint32_t *hi)
{
    double reach = fmax(FINDER_NEAR * g->sigma, 1.5), from = ceil(g->at - reach), to = floor(g->at + reach);
    const double first = peak->from, last = peak->to - 1.0;
    if (g->at - g->sigma < first || g->at + g->sigma > last) return 0;
    *lo = (uint32_t)fmax(from, first);
    *hi = (uint32_t)fmin(to, last);
    return *hi - *lo >= 2;
}

static double fit_short(double step)
{
    return step > 0.4 ? 0.4 : step < -0.4 ? -0.4 : step;
}

double finder_fit_near(const struct finder_run *run, const struct finder_peak *peak, struct finder_term *g)
{
    double side[2], p[3];
    uint32_t lo = 0, hi = 0;
    g->peak = run->y[peak->top];
    if (finder_half(run, peak, g->peak, side) == 0) return -1.0;
    g->at = 0.5 * (side[0] + side[1]);
    g->sigma = fmax((side[1] - side[0]) / FINDER_FWHM, 0.5);
    for (int i = 0; i < FIT_STEPS; i++) {
        struct fit_sums sums;
        /* Later steps keep their samples: one at the border might go in and out for ever. */
        if (i < 3 && !fit_samples(peak, g, &lo, &hi)) return -1.0;
        fit_sum(run, g, lo, hi, &sums);
        double gain = fit_step(&sums, g->peak, p);
        if (gain < 0.0) return -1.0;
        g->peak *= 1.0 + fit_short(p[0]);
        g->at += g->sigma * fit_short(p[1]);
        g->sigma *= 1.0 + fit_short(p[2]);
        const double noise2 = run->finder->noise * run->finder->noise;
        if (gain <= FIT_ENOUGH * noise2 + 1e-8 * g->peak * g->peak)
            return sqrt(fmax(0.0, sums.rest2 - gain) / fmax(1.0, sums.n - 3.0));
    }
    return -1.0;
}

/* Beyond the fit no sample may exceed the term by more than noise and the learned tail explain. */
static int fit_alone(const struct finder_run *run, const struct finder_peak *peak, const struct finder_term *g,
                     double tail)
{
    const double most = tail * g->peak + 4.5 * run->finder->noise;
    const double from = fmax(ceil(g->at - run->finder->reach[0] * g->sigma), peak->from);
    const double to = fmin(floor(g->at + run->finder->reach[1] * g->sigma), peak->to - 1.0);
    for (double x = from; x <= to; x += 1.0) {
        double d = (x - g->at) / g->sigma;
        if (fabs(d) <= FINDER_NEAR) {
            x = fmax(x, floor(g->at + FINDER_NEAR * g->sigma));
            continue;
        }
        double y = run->y[(uint32_t)x];
        if (y > most && y > most + g->peak * finder_value(run->finder, d)) return 0;
    }
    return 1;
}

/* The quantile of chi^2 over n follows Wilson's and Hilferty's approximation (1931), at 4 sigma: one in 30,000 lies
 * beyond. */
double finder_noise2(const struct finder *finder, double n)
{
    const double by = 2.0 / (9.0 * n), root = 1.0 - by + 4.0 * sqrt(by);
    return finder->noise * finder->noise * root * root * root;
}

/* Returns the RMS that noise explains, together with the misfit of echoes on planes. */
static double fit_explained(const struct finder_run *run, const struct finder_term *g, double misfit)
{
    const double left = (1.2 * misfit + FINDER_ROUGH) * g->peak;
    return sqrt(finder_noise2(run->finder, fmax(1.0, 2.0 * FINDER_NEAR * g->sigma - 2.0)) + left * left);
}

int finder_fit(const struct finder_run *run, const struct finder_peak *peak, struct finder_term *g)
{
    const struct finder *finder = run->finder;
    struct finder_spread spread;
    double rms = finder_fit_near(run, peak, g);
    if (rms < 0.0 || g->sigma < FINDER_LEAST * finder->spread[0].sigma) return 0;
    finder_find(finder, FINDER_SIGMA, g->sigma, &spread);
    return rms <= fit_explained(run, g, spread.misfit) && fit_alone(run, peak, g, 1.2 * spread.tail + FINDER_ROUGH);
}
