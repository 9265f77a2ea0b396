/* SPDX-License-Identifier: MIT */
/* Maxima that run into each other, or whose tops are not seen, are a sum of terms. This file says with which terms
 * the fit begins, and how many there are. */
#include "core/waveform/detect_inside.h"

#include <math.h>

enum {
    DECOMPOSE_TURNS = 2,
    DECOMPOSE_REACH = 64, /* a pulse is fitted to the residual in up to so many samples on each side of its centre */
};

/* A mixture takes the samples from the foot before its first maximum to the foot after its last maximum. A foot is
 * where the signal has fallen near the noise or to 0.5 % of the maximum, or where the samples of the maximum end. The
 * mixture takes a sigma of the pulse more on both sides. */
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
    task->lo = (uint32_t)fmax(lo - margin, peak->from);
    task->hi = (uint32_t)fmin(hi + margin, last->to - 1.0);
    task->variance = run->finder->noise * run->finder->noise;
}

/* Returns the height of a top that stays above the limit for `span` samples. The function widens an interval of the
 * pulse's shape h around its peak, at the higher end first, until the interval is that long. At the interval's ends h
 * then has the limit's share of the peak. *centroid: samples from where the limit is reached to the pulse's
 * centroid. */
static double decompose_height(const struct finder *finder, double span, double *centroid)
{
    const double *h = finder->shape, steps = span / (FINDER_SHAPE_STEP * finder->width);
    uint32_t a = finder->top, b;
    for (b = a; b - a < steps && a > 0 && b + 1 < FINDER_SHAPE;) {
        if (h[a - 1] > h[b + 1])
            a--;
        else
            b++;
    }
    *centroid = (FINDER_SHAPE_LEAD - a * FINDER_SHAPE_STEP) * finder->width;
    return finder->limit / fmax(fmax(h[a], h[b]), 1e-6);
}

/* Does the same by the rising flank alone, whose last samples are y0 and y1. The higher the top is, the faster its
 * flank rises from y0 to y1. The function looks for the height at which this rise takes exactly one sample. *centroid
 * counts from the sample of y1. */
static double decompose_flank(const struct finder *finder, double y0, double y1, double *centroid)
{
    double least = 0.0, most = 9.0; /* logarithms of the peak over y1; more than 39 dB is not believed */
    for (int i = 0; i < 20; i++) {
        double half = 0.5 * (least + most), part = exp(-half);
        if (finder_lead(finder, part * y0 / y1) - finder_lead(finder, part) > 1.0)
            least = half;
        else
            most = half;
    }
    *centroid = finder_lead(finder, exp(-least));
    return y1 * exp(least);
}

/* Fits a top that is limited. Where the receiver went blind after it, the last two samples of the rising flank
 * decide. Then the function returns 1, since a fit to these two has nothing to add. */
static int decompose_limited(const struct finder_run *run, const struct finder_peak *peak, struct finder_term *g)
{
    const struct finder *finder = run->finder;
    uint32_t a = peak->top, b = peak->top;
    while (a > peak->from && run->mark[a - 1] == FINDER_LIMITED)
        a--;
    while (b + 1 < peak->to && run->mark[b + 1] == FINDER_LIMITED)
        b++;
    int blind = b + 1 < peak->to && run->mark[b + 1] == FINDER_BLIND;
    double centroid, height, from = (double)a - 0.5;
    if (!blind) {
        height = decompose_height(finder, (double)b - (double)a + 1.0, &centroid);
    } else {
        /* A sample below 3 sigma can't be told from noise. The value 1.5 sigma takes the place of such a sample. */
        const double least = 1.5 * finder->noise;
        uint32_t k = a > peak->from && run->y[a - 1] > 2.0 * least ? a - 1 : a;
        height = decompose_flank(finder, k > peak->from ? fmax(run->y[k - 1], least) : least,
                                 fmin(run->y[k], finder->limit), &centroid);
        from = k;
    }
    const double at = from + centroid + finder->spread[0].lag;
    *g = (struct finder_term){at, finder->spread[0].sigma, fmax(height, finder->limit)};
    return blind;
}

/* Begins with one term for each maximum. Returns 1 where nothing is left to fit. */
static int decompose_begin(const struct finder_run *run, const struct finder_peak *peak, uint32_t n,
                           struct finder_mix *mix)
{
    int blind = 0;
    *mix = (struct finder_mix){.n = n};
    for (uint32_t j = 0; j < n; j++) {
        struct finder_term *g = &mix->g[j];
        double side[2], height = run->y[peak[j].top];
        if (finder_limited(run, &peak[j])) {
            mix->limited |= 1U << j;
            if (height >= run->finder->peak) mix->seen |= 1U << j;
            mix->open |= 1U << j;
            blind |= decompose_limited(run, &peak[j], g);
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
    return n == 1 && blind;
}

/* Returns the sum of squares that remains without noise, since the echo of a plane has another shape than a term. */
static double decompose_shapes(const struct finder_task *task, const struct finder_mix *mix)
{
    double sum = 0.0;
    for (uint32_t j = 0; j < mix->n; j++) {
        struct finder_spread spread;
        finder_find(task->run->finder, FINDER_SIGMA, mix->g[j].sigma, &spread);
        double left = (1.2 * spread.misfit + FINDER_ROUGH) * mix->g[j].peak;
        sum += left * left * 2.0 * FINDER_NEAR * mix->g[j].sigma;
    }
    return sum;
}

static int decompose_enough(const struct finder_task *task, const struct finder_mix *mix)
{
    double n = fmax(1.0, task->hi - task->lo + 1.0 - 3.0 * mix->n);
    return mix->chi2 <= n * finder_noise2(task->run->finder, n) + decompose_shapes(task, mix);
}

/* Returns the pulse that explains most of the residual. At each place it gets its amplitude by least squares. */
static struct finder_term decompose_largest(const struct finder_task *task, const double *rest)
{
    const double sigma = task->run->finder->spread[0].sigma;
    const int32_t reach = (int32_t)ceil(2.0 * sigma), n = (int32_t)(task->hi - task->lo + 1);
    struct finder_term best = {0.0, sigma, 0.0};
    double kernel[2 * DECOMPOSE_REACH + 1];
    const int32_t side = reach < DECOMPOSE_REACH ? reach : DECOMPOSE_REACH;
    for (int32_t k = -side; k <= side; k++)
        kernel[k + side] = finder_value(task->run->finder, k / sigma);
    for (int32_t i = 0; i < n; i++) {
        double by = 0.0, squares = 0.0;
        for (int32_t k = -side; k <= side; k++)
            if (i + k >= 0 && i + k < n) {
                by += kernel[k + side] * rest[i + k];
                squares += kernel[k + side] * kernel[k + side];
            }
        if (by > best.peak * squares) best = (struct finder_term){(double)task->lo + i, sigma, by / squares};
    }
    return best;
}

/* Puts two pulses in place of one component that is wider than the pulse. Together they have the component's energy and
 * variance. */
static int decompose_split(const struct finder_task *task, struct finder_mix *mix)
{
    const double sigma = task->run->finder->spread[0].sigma;
    uint32_t widest = 0;
    for (uint32_t j = 1; j < mix->n; j++)
        if (mix->g[j].sigma > mix->g[widest].sigma) widest = j;
    struct finder_term *g = &mix->g[widest];
    if (g->sigma < 1.05 * sigma || mix->open >> widest & 1) return 0;
    double apart = sqrt(g->sigma * g->sigma - sigma * sigma), peak = 0.5 * g->peak * g->sigma / sigma;
    mix->g[mix->n++] = (struct finder_term){g->at + apart, sigma, peak};
    *g = (struct finder_term){g->at - apart, sigma, peak};
    return 1;
}

/* Returns whether all components could be echoes: none is below the least peak, nearer to another one than 0.35 sigma
 * of the pulse, or explained by the tail of a larger one. */
static int decompose_sound(const struct finder_task *task, const struct finder_mix *mix, double least)
{
    for (uint32_t j = 0; j < mix->n; j++)
        for (uint32_t k = 0; k < mix->n; k++) {
            const struct finder_term *a = &mix->g[j], *b = &mix->g[k];
            if (a->peak < least) return 0;
            if (j == k) continue;
            struct finder_spread spread;
            double apart = fabs(a->at - b->at);
            if (apart < 0.35 * task->run->finder->spread[0].sigma) return 0;
            finder_find(task->run->finder, FINDER_SIGMA, b->sigma, &spread);
            if (apart < 5.0 * b->sigma && a->peak < (2.0 * spread.tail + FINDER_ROUGH) * b->peak) return 0;
        }
    return 1;
}

/* Adds a component for the residual. */
static int decompose_extra(const struct finder_task *task, double least, struct finder_mix *mix)
{
    double rest[WAVEFORM_MAX_SAMPLES];
    finder_mix_rest(task, mix, rest);
    struct finder_term more = decompose_largest(task, rest);
    if (more.peak < least) return 0;
    mix->g[mix->n++] = more;
    return 1;
}

/* Adds one more component, in one of two ways; the second is tried where the first leaves more than noise. Returns 1
 * where the mixture became better. */
static int decompose_more(const struct finder_task *task, double least, struct finder_mix *mix)
{
    struct finder_mix tried[2] = {*mix, *mix}, *best = NULL;
    for (int i = 0; i < 2; i++) {
        if (!(i == 0 ? decompose_extra(task, least, &tried[i]) : decompose_split(task, &tried[i]))) continue;
        finder_mix_fit(task, &tried[i]);
        if (!decompose_sound(task, &tried[i], least) || (best != NULL && tried[i].chi2 >= best->chi2)) continue;
        best = &tried[i];
        if (decompose_enough(task, best)) break;
    }
    /* Three more parameters lower the sum by 3 variances if they mean nothing. By chance they lower it by 25 variances
     * in one case of 60,000. */
    if (best == NULL || mix->chi2 - best->chi2 < 25.0 * task->variance + decompose_shapes(task, best)) return 0;
    *mix = *best;
    return 1;
}

/* A component that was added early may be in a place where no echo is now: the others explain the samples without
 * it. Only the two weakest are tried, since each try costs a fit. */
static void decompose_fewer(const struct finder_task *task, double least, struct finder_mix *mix)
{
    uint32_t tried = 0;
    for (uint32_t turn = 0; turn < DECOMPOSE_TURNS && mix->n > 2; turn++) {
        struct finder_mix fewer = *mix;
        uint32_t weakest = FINDER_MIX;
        for (uint32_t j = 0; j < mix->n; j++)
            if (!(tried >> j & 1) && (weakest == FINDER_MIX || mix->g[j].peak < mix->g[weakest].peak)) weakest = j;
        if (weakest == FINDER_MIX) return;
        tried |= 1U << weakest;
        fewer.g[weakest] = fewer.g[--fewer.n];
        finder_mix_fit(task, &fewer);
        if (!decompose_enough(task, &fewer) || !decompose_sound(task, &fewer, least)) continue;
        *mix = fewer;
        tried = 0;
    }
}

/* Makes two pulses with the energy, the mean, the variance and the third moment of the samples. With shares p
 * and q of the energy, d apart, they have the pulse's variance plus p q d^2, and its third moment plus
 * p q (p - q) d^3. */
static int decompose_two(const struct finder_task *task, struct finder_mix *mix)
{
    const struct finder *finder = task->run->finder;
    const double sigma = finder->spread[0].sigma, lag = finder->spread[0].lag;
    double m[4] = {0.0}, middle = 0.5 * ((double)task->lo + (double)task->hi);
    for (uint32_t i = task->lo; i <= task->hi; i++) {
        double x = i - middle, y = task->run->y[i];
        m[0] += y;
        m[1] += y * x;
        m[2] += y * x * x;
        m[3] += y * x * x * x;
    }
    const double mean = m[1] / m[0], square = m[2] / m[0] - mean * mean, more = square - finder->variance;
    const double third = m[3] / m[0] - 3.0 * mean * m[2] / m[0] + 2.0 * mean * mean * mean - finder->third;
    if (!(m[0] > 0.0 && more > 0.05 * sigma * sigma)) return 0;
    const double skew = third / (more * sqrt(more)), p = 0.5 + 0.5 * skew / sqrt(skew * skew + 4.0);
    const double apart = sqrt(more / (p * (1.0 - p))), at = middle + mean + lag;
    const double height = m[0] * finder->peak / finder->area;
    *mix = (struct finder_mix){
        .n = 2, .g = {{at - (1.0 - p) * apart, sigma, p * height}, {at + p * apart, sigma, (1.0 - p) * height}}};
    return 1;
}

void finder_decompose(const struct finder_run *run, const struct finder_peak *peak, uint32_t n, int adds,
                      struct finder_mix *mix)
{
    const double least = adds ? fmax(0.5 * run->finder->peak, 4.0 * run->finder->noise) : (double)INFINITY;
    struct finder_task task;
    decompose_range(run, peak, n, &task);
    if (decompose_begin(run, peak, n, mix)) return;
    /* The caller has found that one term is not enough for these samples. In most cases two are. */
    struct finder_mix two;
    if (n == 1 && mix->open == 0 && run->mark == NULL && adds && decompose_two(&task, &two)) {
        finder_mix_fit(&task, &two);
        if (decompose_sound(&task, &two, least) && decompose_enough(&task, &two)) {
            *mix = two;
            return;
        }
    }
    finder_mix_fit(&task, mix);
    while (mix->n < FINDER_MIX && !decompose_enough(&task, mix) && decompose_more(&task, least, mix)) {
    }
    /* decompose_fewer changes the components' order, which bits of mix->open would not follow. */
    if (mix->n > n + 1 && mix->open == 0) decompose_fewer(&task, least, mix);
}
