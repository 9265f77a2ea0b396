/* SPDX-License-Identifier: MIT */
/* One Gaussian through the samples of one maximum: the way of nearly all echoes, so it has to be cheap.
 *
 * The half maxima give a first Gaussian. Gauss and Newton's steps then minimise the squares of what is left within
 * FINDER_NEAR sigma of its centre. Samples further out would lower the variance of the range by 1.3 % (the part of the
 * integral of x^2 exp(-x^2) beyond 2.5), but they bring in neighbours. At equal steps a Gaussian follows from the sample
 * before by two products, since the ratio of neighbours changes by a constant factor. */
#include "core/waveform/detect_inside.h"

#include <math.h>

enum { FIT_STEPS = 24 }; /* 3 are usual; a pulse that is no Gaussian takes more */
/* The fit has come to its end where another step would lower the sum of squares by this part of a sample's variance. */
#define FIT_ENOUGH 0.01

/* Sums over the samples of g^2 d^k, of rest g d^k and of rest^2; g the Gaussian of peak 1, d the place in sigmas. */
struct fit_sums {
    double s[5], r[3], rest2;
    uint32_t n;
};

static void fit_sum(const struct finder_run *run, const struct finder_gaussian *g, uint32_t lo, uint32_t hi,
                    struct fit_sums *sums)
{
    const double step = 1.0 / g->sigma;
    double d = ((double)lo - g->at) * step, value = exp(-0.5 * d * d);
    double ratio = exp(-step * (d + 0.5 * step)), change = exp(-step * step);
    *sums = (struct fit_sums){.n = hi - lo + 1};
    for (uint32_t i = lo; i <= hi; i++) {
        double rest = run->y[i] - g->peak * value, v2 = value * value, rv = rest * value, d2 = d * d;
        sums->s[0] += v2;
        sums->s[1] += v2 * d;
        sums->s[2] += v2 * d2;
        sums->s[3] += v2 * d2 * d;
        sums->s[4] += v2 * d2 * d2;
        sums->r[0] += rv;
        sums->r[1] += rv * d;
        sums->r[2] += rv * d2;
        sums->rest2 += rest * rest;
        value *= ratio;
        ratio *= change;
        d += step;
    }
}

/* The step for log peak, centre in sigmas and log sigma: Cramer's rule on the symmetric 3 x 3 of the sums. Returns by how
 * much it lowers the sum of squares, below 0 where the samples don't determine it. */
static double fit_step(const struct fit_sums *m, double peak, double p[3])
{
    const double *s = m->s, *r = m->r;
    double c0 = s[2] * s[4] - s[3] * s[3], c1 = s[2] * s[3] - s[1] * s[4], c2 = s[1] * s[3] - s[2] * s[2];
    double det = s[0] * c0 + s[1] * c1 + s[2] * c2;
    if (!(det > 1e-9 * s[0] * s[2] * s[4])) return -1.0;
    double c3 = s[0] * s[4] - s[2] * s[2], c4 = s[1] * s[2] - s[0] * s[3], c5 = s[0] * s[2] - s[1] * s[1];
    double by = 1.0 / (det * peak);
    p[0] = by * (c0 * r[0] + c1 * r[1] + c2 * r[2]);
    p[1] = by * (c1 * r[0] + c3 * r[1] + c4 * r[2]);
    p[2] = by * (c2 * r[0] + c4 * r[1] + c5 * r[2]);
    return peak * (p[0] * r[0] + p[1] * r[1] + p[2] * r[2]);
}

/* Samples within FINDER_NEAR sigma, or at least 4. Returns 0 where the peak's samples don't reach both flanks. */
static int fit_samples(const struct finder_peak *peak, const struct finder_gaussian *g, uint32_t *lo, uint32_t *hi)
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

double finder_fit_near(const struct finder_run *run, const struct finder_peak *peak, struct finder_gaussian *g)
{
    double side[2], p[3];
    uint32_t lo = 0, hi = 0;
    g->peak = run->y[peak->top];
    if (finder_half(run, peak, g->peak, side) == 0) return -1.0;
    g->at = 0.5 * (side[0] + side[1]);
    g->sigma = fmax((side[1] - side[0]) / FINDER_FWHM, 0.5);
    for (int i = 0; i < FIT_STEPS; i++) {
        struct fit_sums sums;
        /* A sample at the border might go in and out for ever. */
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

/* Beyond the fit no sample may exceed the Gaussian by what noise, the pulse's tail, or 0.7 of an echo explain. */
static int fit_alone(const struct finder_run *run, const struct finder_peak *peak, const struct finder_gaussian *g,
                     double tail)
{
    const double most = tail * g->peak + 4.5 * run->finder->noise;
    const double reach = 4.5 * g->sigma;
    const double from = fmax(ceil(g->at - reach), peak->from), to = fmin(floor(g->at + reach), peak->to - 1.0);
    for (double x = from; x <= to; x += 1.0) {
        double d = (x - g->at) / g->sigma;
        if (fabs(d) <= FINDER_NEAR) {
            x = fmax(x, floor(g->at + FINDER_NEAR * g->sigma));
            continue;
        }
        double y = run->y[(uint32_t)x];
        if (y > most && y > most + g->peak * exp(-0.5 * d * d)) return 0;
    }
    return 1;
}

/* The RMS that noise explains, and what echoes on planes leave. The estimate of a variance from n samples has a deviation
 * of sqrt(2 / n) of it; four of these are allowed. */
static double fit_explained(const struct finder_run *run, const struct finder_gaussian *g, double misfit)
{
    const double noise = run->finder->noise, left = (1.2 * misfit + FINDER_ROUGH) * g->peak;
    const double n = fmax(1.0, 2.0 * FINDER_NEAR * g->sigma - 2.0);
    return sqrt(noise * noise * (1.0 + 4.0 * sqrt(2.0 / n)) + left * left);
}

int finder_fit(const struct finder_run *run, const struct finder_peak *peak, struct finder_gaussian *g)
{
    const struct finder *finder = run->finder;
    struct finder_spread spread;
    double rms = finder_fit_near(run, peak, g);
    if (rms < 0.0 || g->sigma < FINDER_LEAST * finder->spread[0].sigma) return 0;
    finder_by_sigma(finder, g->sigma, &spread);
    return rms <= fit_explained(run, g, spread.misfit) && fit_alone(run, peak, g, spread.tail + FINDER_ROUGH);
}
