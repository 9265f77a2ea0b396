/* SPDX-License-Identifier: MIT */
/* Maxima that run into each other, or whose tops are not seen, as a sum of Gaussians: where it begins, and when what is
 * left over asks for one more. */
#include "core/waveform/detect_inside.h"

#include <math.h>

enum { DECOMPOSE_REACH = 64 }; /* samples: how far a pulse is compared with the rest */

/* The samples of a mixture: from its first maximum down to the foot, or to the window's end, and so behind its last. */
static void decompose_range(const struct finder_run *run, const struct finder_peak *peak, uint32_t n,
                            struct finder_task *task)
{
    const struct finder_peak *last = &peak[n - 1];
    const double margin = ceil(run->finder->spread[0].sigma), noise = 2.0 * run->finder->noise;
    uint32_t lo = peak->top, hi = last->top;
    while (lo > peak->from && run->y[lo] > fmax(noise, 0.005 * run->y[peak->top]))
        lo--;
    while (hi + 1 < last->to && run->y[hi] > fmax(noise, 0.005 * run->y[last->top]))
        hi++;
    task->run = run;
    task->lo = lo > margin ? lo - (uint32_t)margin : 0;
    task->hi = hi + margin < run->n ? hi + (uint32_t)margin : run->n - 1;
    task->variance = run->finder->noise * run->finder->noise;
}

/* A top that is limited. With both flanks seen, the pulse is as high as it has to be to stay above the limit for so long.
 * Where the receiver went blind, the rising flank's last two samples have to do: the log of a Gaussian has the slope
 * (at - x) / sigma^2. */
static void decompose_limited(const struct finder_run *run, const struct finder_peak *peak, struct finder_gaussian *g)
{
    const double sigma = run->finder->spread[0].sigma, noise = run->finder->noise, limit = run->finder->limit;
    uint32_t a = peak->top, b = peak->top;
    while (a > peak->from && run->mark[a - 1] == FINDER_LIMITED)
        a--;
    while (b + 1 < peak->to && run->mark[b + 1] == FINDER_LIMITED)
        b++;
    int blind = b + 1 < peak->to && run->mark[b + 1] == FINDER_BLIND;
    double at = 0.5 * ((double)a + (double)b);
    if (blind) at = (double)a + sigma;
    if (blind && a >= peak->from + 2 && run->y[a - 2] > 3.0 * noise)
        at = (double)a - 1.5 + sigma * sigma * log(run->y[a - 1] / run->y[a - 2]);
    at = fmax(at, (double)a - 0.5);
    double d = (at - ((double)a - 0.5)) / sigma;
    *g = (struct finder_gaussian){at, sigma, limit * exp(fmin(0.5 * d * d, 20.0))};
}

static void decompose_begin(const struct finder_run *run, const struct finder_peak *peak, uint32_t n,
                            struct finder_mix *mix)
{
    *mix = (struct finder_mix){.n = n};
    for (uint32_t j = 0; j < n; j++) {
        struct finder_gaussian *g = &mix->g[j];
        double side[2], height = run->y[peak[j].top];
        if (finder_limited(run, &peak[j])) {
            mix->limited |= 1U << j;
            mix->open |= 1U << j;
            decompose_limited(run, &peak[j], g);
            continue;
        }
        int seen = finder_half(run, &peak[j], height, side);
        if (peak[j].top == 0 || peak[j].top + 1 == run->n || seen == 0) mix->open |= 1U << j;
        double sigma = (side[1] - side[0]) / FINDER_FWHM;
        int usable = seen > 0 && sigma > run->finder->spread[0].sigma;
        g->at = seen == 2 ? 0.5 * (side[0] + side[1]) : (double)peak[j].top;
        g->sigma = usable ? sigma : run->finder->spread[0].sigma;
        g->peak = height;
    }
}

/* What the shapes of echoes on planes leave when Gaussians fit them, as a sum of squares. */
static double decompose_shapes(const struct finder_task *task, const struct finder_mix *mix)
{
    double sum = 0.0;
    for (uint32_t j = 0; j < mix->n; j++) {
        struct finder_spread spread;
        finder_by_sigma(task->run->finder, mix->g[j].sigma, &spread);
        double left = (1.2 * spread.misfit + FINDER_ROUGH) * mix->g[j].peak;
        sum += left * left * 2.0 * FINDER_NEAR * mix->g[j].sigma;
    }
    return sum;
}

static int decompose_enough(const struct finder_task *task, const struct finder_mix *mix)
{
    double n = fmax(1.0, task->hi - task->lo + 1.0 - 3.0 * mix->n);
    return mix->chi2 <= n * task->variance * (1.0 + 4.0 * sqrt(2.0 / n)) + decompose_shapes(task, mix);
}

/* The pulse that explains most of the rest: its amplitude by least squares at each place. */
static struct finder_gaussian decompose_largest(const struct finder_task *task, const double *rest)
{
    const double sigma = task->run->finder->spread[0].sigma;
    const int32_t reach = (int32_t)ceil(2.0 * sigma), n = (int32_t)(task->hi - task->lo + 1);
    struct finder_gaussian best = {0.0, sigma, 0.0};
    double kernel[2 * DECOMPOSE_REACH + 1];
    const int32_t side = reach < DECOMPOSE_REACH ? reach : DECOMPOSE_REACH;
    for (int32_t k = -side; k <= side; k++)
        kernel[k + side] = exp(-0.5 * (k / sigma) * (k / sigma));
    for (int32_t i = 0; i < n; i++) {
        double by = 0.0, squares = 0.0;
        for (int32_t k = -side; k <= side; k++)
            if (i + k >= 0 && i + k < n) {
                by += kernel[k + side] * rest[i + k];
                squares += kernel[k + side] * kernel[k + side];
            }
        if (by > best.peak * squares) best = (struct finder_gaussian){(double)task->lo + i, sigma, by / squares};
    }
    return best;
}

/* Two pulses in place of one component that is wider than the pulse: with its energy and its variance. */
static int decompose_split(const struct finder_task *task, struct finder_mix *mix)
{
    const double sigma = task->run->finder->spread[0].sigma;
    uint32_t widest = 0;
    for (uint32_t j = 1; j < mix->n; j++)
        if (mix->g[j].sigma > mix->g[widest].sigma) widest = j;
    struct finder_gaussian *g = &mix->g[widest];
    if (g->sigma < 1.05 * sigma || mix->open >> widest & 1) return 0;
    double apart = sqrt(g->sigma * g->sigma - sigma * sigma), peak = 0.5 * g->peak * g->sigma / sigma;
    mix->g[mix->n++] = (struct finder_gaussian){g->at + apart, sigma, peak};
    *g = (struct finder_gaussian){g->at - apart, sigma, peak};
    return 1;
}

/* Components that could be echoes: none is below half of the level, or what the tail of a larger one explains. */
static int decompose_sound(const struct finder_task *task, const struct finder_mix *mix, double least)
{
    for (uint32_t j = 0; j < mix->n; j++)
        for (uint32_t k = 0; k < mix->n; k++) {
            const struct finder_gaussian *a = &mix->g[j], *b = &mix->g[k];
            if (a->peak < least) return 0;
            if (j == k) continue;
            struct finder_spread spread;
            double apart = fabs(a->at - b->at);
            if (apart < 0.35 * task->run->finder->spread[0].sigma) return 0;
            finder_by_sigma(task->run->finder, b->sigma, &spread);
            if (apart < 5.0 * b->sigma && a->peak < (2.0 * spread.tail + FINDER_ROUGH) * b->peak) return 0;
        }
    return 1;
}

/* One more component, in the two ways that there are. Returns 1 where a better mixture came of it. */
static int decompose_more(const struct finder_task *task, double least, struct finder_mix *mix)
{
    double rest[WAVEFORM_MAX_SAMPLES];
    struct finder_mix tried[2] = {*mix, *mix}, *best = NULL;
    finder_mix_rest(task, mix, rest);
    struct finder_gaussian more = decompose_largest(task, rest);
    int n = 0;
    if (more.peak >= least) {
        tried[n].g[tried[n].n++] = more;
        n++;
    }
    n += decompose_split(task, &tried[n]);
    for (int i = 0; i < n; i++) {
        finder_mix_fit(task, &tried[i]);
        int sound = decompose_sound(task, &tried[i], least);
        if (sound && (best == NULL || tried[i].chi2 < best->chi2)) best = &tried[i];
    }
    /* Three more parameters lower the sum by 3 variances if they mean nothing; 25 by chance in one of 60,000. */
    if (best == NULL || mix->chi2 - best->chi2 < 25.0 * task->variance + decompose_shapes(task, best)) return 0;
    *mix = *best;
    return 1;
}

void finder_decompose(const struct finder_run *run, const struct finder_peak *peak, uint32_t n, double level,
                      struct finder_mix *mix)
{
    struct finder_task task;
    decompose_range(run, peak, n, &task);
    decompose_begin(run, peak, n, mix);
    finder_mix_fit(&task, mix);
    const double least = fmax(0.5 * level * run->finder->peak, 4.0 * run->finder->noise);
    while (mix->n < FINDER_MIX && !decompose_enough(&task, mix) && decompose_more(&task, least, mix)) {
    }
}
