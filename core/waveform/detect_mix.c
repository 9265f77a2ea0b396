/* SPDX-License-Identifier: MIT */
/* A sum of terms fitted to samples: Levenberg's and Marquardt's steps with analytic derivatives, after W. Wagner et
 * al., Gaussian decomposition and calibration of a novel small-footprint full-waveform digitising airborne laser
 * scanner, 2006.
 *
 * Parameters of a component are log peak, centre in its sigmas, and log sigma: all of one size, and no step makes a
 * peak or a sigma negative. A limited sample only says that the signal is at least so large: it counts where the model
 * is below the limit. So a saturated echo is kept from being fitted to its flat top. A blind sample does not count. */
#include "core/waveform/detect_inside.h"

#include <math.h>
#include <string.h>

#include "core/vecmath.h"

enum { MIX_MOST = 3 * FINDER_MIX, MIX_STEPS = 12 };

struct mix_normal {
    double h[MIX_MOST][MIX_MOST], r[MIX_MOST];
};

/* Samples are taken in blocks. A row has one derivative at each sample of the block, and 0 at samples that
 * the component does not reach. */
enum { MIX_BLOCK = 48, MIX_LANES = 8 };
struct mix_block {
    double row[MIX_MOST][MIX_BLOCK], rest[MIX_BLOCK];
};

/* A component on its way along the samples (detect_fit.c has the recurrence). */
struct mix_walker {
    uint32_t lo, hi; /* samples that it reaches */
    double step, d, peak, value, ratio, change;
    const struct finder *finder;
};

static void mix_begin(const struct finder_task *task, const struct finder_term *g, struct mix_walker *walker)
{
    const struct finder *finder = task->run->finder;
    const double from = fmax(ceil(g->at - finder->reach[0] * g->sigma), task->lo);
    const double to = fmin(floor(g->at + finder->reach[1] * g->sigma), task->hi);
    *walker = (struct mix_walker){.lo = 1, .hi = 0, .step = 1.0 / g->sigma, .peak = g->peak, .finder = finder};
    if (from > to) return;
    walker->lo = (uint32_t)from;
    walker->hi = (uint32_t)to;
    walker->d = (from - g->at) * walker->step;
    if (!finder->gaussian) return;
    walker->value = g->peak * exp(-0.5 * walker->d * walker->d);
    walker->ratio = exp(-walker->step * (walker->d + 0.5 * walker->step));
    walker->change = exp(-walker->step * walker->step);
}

/* Computes a component's values and derivatives in samples first .. first + MIX_BLOCK - 1. */
static void mix_rows(struct mix_walker *walker, uint32_t first, double (*restrict row)[MIX_BLOCK])
{
    struct mix_walker w = *walker;
    const uint32_t from = w.lo > first ? w.lo - first : 0;
    const uint32_t to = w.hi - first < MIX_BLOCK ? w.hi - first + 1 : MIX_BLOCK;
    for (uint32_t a = 0; a < 3; a++) {
        for (uint32_t k = 0; k < from; k++)
            row[a][k] = 0.0;
        for (uint32_t k = to; k < MIX_BLOCK; k++)
            row[a][k] = 0.0;
    }
    for (uint32_t k = from; k < to; k++, w.d += w.step) {
        if (w.finder->gaussian) {
            row[0][k] = w.value;
            w.value *= w.ratio;
            w.ratio *= w.change;
            row[1][k] = row[0][k] * w.d;
        } else {
            row[0][k] = w.peak * finder_value(w.finder, w.d);
            row[1][k] = finder_fall(w.finder, w.d, row[0][k]);
        }
        row[2][k] = row[1][k] * w.d;
    }
    *walker = w;
}

/* Sums in lanes, so that the sum is the same with any width of vectors. */
VEC_INLINE double mix_dot(const double *restrict a, const double *restrict b)
{
    double sum[MIX_LANES] = {0.0};
    for (uint32_t k = 0; k < MIX_BLOCK; k += MIX_LANES)
        for (uint32_t j = 0; j < MIX_LANES; j++)
            sum[j] += a[k + j] * b[k + j];
    return ((sum[0] + sum[4]) + (sum[2] + sum[6])) + ((sum[1] + sum[5]) + (sum[3] + sum[7]));
}

/* Adds a block to the lower half of the normal equations; its rows are those of the n components in `active`. Returns
 * its sum of squares. */
VEC_CLONES
static double mix_add(const struct mix_block *block, const uint32_t *active, uint32_t n, struct mix_normal *normal)
{
    for (uint32_t a = 0; a < 3 * n; a++) {
        const uint32_t x = 3 * active[a / 3] + a % 3;
        normal->r[x] += mix_dot(block->row[a], block->rest);
        for (uint32_t b = 0; b <= a; b++)
            normal->h[x][3 * active[b / 3] + b % 3] += mix_dot(block->row[a], block->row[b]);
    }
    return mix_dot(block->rest, block->rest);
}

/* Sets what the model leaves of sample i. Returns whether the sample says anything. */
static int mix_rest(const struct finder_run *run, uint32_t i, double model, double *rest)
{
    if (run->mark[i] == FINDER_PLAIN) *rest = run->y[i] - model;
    if (run->mark[i] == FINDER_LIMITED) *rest = fmax(0.0, run->finder->limit - model);
    return run->mark[i] == FINDER_PLAIN || *rest > 0.0;
}

/* Fills a block from the walkers that reach it, whose numbers go to `active`. Returns how many do. */
static uint32_t mix_fill(const struct finder_task *task, struct mix_walker *walker, uint32_t components, uint32_t first,
                         struct mix_block *block, uint32_t *active)
{
    uint32_t n = 0;
    double model[MIX_BLOCK] = {0.0};
    for (uint32_t j = 0; j < components; j++) {
        if (walker[j].lo >= first + MIX_BLOCK || walker[j].hi < first || walker[j].lo > walker[j].hi) continue;
        mix_rows(&walker[j], first, &block->row[3 * n]);
        for (uint32_t k = 0; k < MIX_BLOCK; k++)
            model[k] += block->row[3 * n][k];
        active[n++] = j;
    }
    const uint32_t left = task->hi + 1 - first, m = left < MIX_BLOCK ? left : MIX_BLOCK;
    memset(block->rest, 0, sizeof block->rest);
    if (task->run->mark == NULL) {
        for (uint32_t k = 0; k < m; k++)
            block->rest[k] = task->run->y[first + k] - model[k];
        return n;
    }
    for (uint32_t k = 0; k < m; k++)
        if (!mix_rest(task->run, first + k, model[k], &block->rest[k]))
            for (uint32_t a = 0; a < 3 * n; a++)
                block->row[a][k] = 0.0;
    return n;
}

/* A sigma is expected to be that of the pulse: within a factor of e^2, or of e^0.03 where the echo's top is not seen.
 * So a flank alone, which many pairs of peak and sigma explain, has one answer. */
static double mix_expect(const struct finder_task *task, const struct finder_mix *mix, struct mix_normal *normal)
{
    double chi2 = 0.0;
    for (uint32_t j = 0; j < mix->n; j++) {
        double q = log(mix->g[j].sigma / task->run->finder->spread[0].sigma);
        double within = mix->open >> j & 1 ? 0.03 : 2.0, weight = task->variance / (within * within);
        chi2 += weight * q * q;
        normal->h[3 * j + 2][3 * j + 2] += weight;
        normal->r[3 * j + 2] -= weight * q;
    }
    return chi2;
}

/* Returns the sum of squares that a mixture leaves, and makes the normal equations for its next step. */
static double mix_walk(const struct finder_task *task, const struct finder_mix *mix, struct mix_normal *normal)
{
    struct mix_walker walker[FINDER_MIX];
    struct mix_block block;
    uint32_t active[FINDER_MIX];
    double chi2 = 0.0;
    for (uint32_t j = 0; j < mix->n; j++)
        mix_begin(task, &mix->g[j], &walker[j]);
    for (uint32_t j = 0; j < 3 * mix->n; j++)
        memset(normal->h[j], 0, 3 * mix->n * sizeof normal->h[j][0]);
    memset(normal->r, 0, sizeof normal->r);
    for (uint32_t i = task->lo; i <= task->hi; i += MIX_BLOCK) {
        uint32_t n = mix_fill(task, walker, mix->n, i, &block, active);
        chi2 += mix_add(&block, active, n, normal);
    }
    return chi2 + mix_expect(task, mix, normal);
}

/* Solves (h + damping diag h) p = r by Cholesky's decomposition. Returns 0 where the matrix is not positive
 * definite. */
static int mix_solve(const struct mix_normal *normal, uint32_t n, double damping, double p[MIX_MOST])
{
    double l[MIX_MOST][MIX_MOST], by[MIX_MOST]; /* by: 1 over the diagonal */
    for (uint32_t i = 0; i < n; i++) {
        double right = normal->r[i];
        for (uint32_t j = 0; j <= i; j++) {
            double sum = normal->h[i][j];
            if (i == j) sum = sum * (1.0 + damping) + 1e-300;
            for (uint32_t k = 0; k < j; k++)
                sum -= l[i][k] * l[j][k];
            if (i == j && !(sum > 0.0)) return 0;
            if (i == j) by[i] = 1.0 / sqrt(sum);
            l[i][j] = sum * by[j];
        }
        for (uint32_t k = 0; k < i; k++)
            right -= l[i][k] * p[k];
        p[i] = right * by[i];
    }
    for (uint32_t i = n; i-- > 0;) {
        for (uint32_t k = i + 1; k < n; k++)
            p[i] -= l[k][i] * p[k];
        p[i] *= by[i];
    }
    return 1;
}

static double mix_within(double x, double least, double most)
{
    return x < least ? least : x > most ? most : x;
}

/* Takes a step, but a shortened one: a peak changes by at most a factor of e^2, a centre by 1.5 sigma. A centre
 * stays among the samples. Where these end with the window, it may lie 3 sigma of the pulse beyond. */
static void mix_move(const struct finder_task *task, const double p[MIX_MOST], struct finder_mix *mix)
{
    const double h = task->run->finder->spread[0].sigma, room = task->hi - task->lo + 1.0;
    const double first = task->lo > 0 ? task->lo : -3.0 * h;
    const double last = task->hi + 1 < task->run->n ? task->hi : task->hi + 3.0 * h;
    for (uint32_t j = 0; j < mix->n; j++, p += 3) {
        struct finder_term *g = &mix->g[j];
        g->peak = mix_within(g->peak * exp(mix_within(p[0], -2.0, 2.0)), 1e-9, 1e12);
        g->at = mix_within(g->at + g->sigma * mix_within(p[1], -1.5, 1.5), first, last);
        g->sigma = mix_within(g->sigma * exp(mix_within(p[2], -0.7, 0.7)), FINDER_LEAST * h, fmax(h, room));
    }
}

void finder_mix_fit(const struct finder_task *task, struct finder_mix *mix)
{
    struct mix_normal normal[2];
    double p[MIX_MOST], damping = 1e-3;
    int now = 0;
    mix->chi2 = mix_walk(task, mix, &normal[now]);
    for (int i = 0; i < MIX_STEPS && damping < 1e7; i++) {
        struct finder_mix next = *mix;
        if (!mix_solve(&normal[now], 3 * mix->n, damping, p)) {
            damping *= 10.0;
            continue;
        }
        mix_move(task, p, &next);
        next.chi2 = mix_walk(task, &next, &normal[1 - now]);
        if (!(next.chi2 <= mix->chi2)) {
            damping *= 6.0;
            continue;
        }
        const double gain = mix->chi2 - next.chi2;
        *mix = next;
        now = 1 - now;
        /* A step with little damping gains at most a tenth of the one before. So once a step gains no more than half of
         * the noise's variance, further ones gain too little. */
        if (gain <= 0.5 * task->variance && damping < 1.0) return;
        damping *= 0.15;
    }
}

void finder_mix_rest(const struct finder_task *task, const struct finder_mix *mix, double *rest)
{
    struct mix_walker walker[FINDER_MIX];
    struct mix_block block;
    uint32_t active[FINDER_MIX];
    for (uint32_t j = 0; j < mix->n; j++)
        mix_begin(task, &mix->g[j], &walker[j]);
    for (uint32_t i = task->lo; i <= task->hi; i += MIX_BLOCK) {
        const uint32_t n = task->hi + 1 - i;
        (void)mix_fill(task, walker, mix->n, i, &block, active);
        memcpy(rest + (i - task->lo), block.rest, (n < MIX_BLOCK ? n : MIX_BLOCK) * sizeof *rest);
    }
}
