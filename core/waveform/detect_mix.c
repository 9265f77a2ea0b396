/* SPDX-License-Identifier: MIT */
/* A sum of Gaussians fitted to samples: Levenberg's and Marquardt's steps with analytic derivatives, after W. Wagner et
 * al., Gaussian decomposition and calibration of a novel small-footprint full-waveform digitising airborne laser scanner,
 * 2006.
 *
 * Parameters of a component are log peak, centre in its sigmas, and log sigma: all of one size, and no step makes a peak
 * or a sigma negative. A limited sample only says that the signal is at least so large: it counts where the model is
 * below it. That keeps a saturated echo from being fitted to its flat top. A blind sample does not count. */
#include "core/waveform/detect_inside.h"

#include <math.h>
#include <string.h>

enum { MIX_MOST = 3 * FINDER_MIX, MIX_STEPS = 40 };
#define MIX_REACH 5.0 /* sigmas: a Gaussian is 4e-6 of its peak there */

struct mix_normal {
    double h[MIX_MOST][MIX_MOST], r[MIX_MOST];
};

/* A component on its way along the samples (detect_fit.c has the recurrence). */
struct mix_walker {
    uint32_t lo, hi; /* samples that it reaches */
    double step, d, value, ratio, change;
};

static void mix_begin(const struct finder_task *task, const struct finder_gaussian *g, struct mix_walker *walker)
{
    double from = ceil(g->at - MIX_REACH * g->sigma), to = floor(g->at + MIX_REACH * g->sigma);
    from = fmax(from, task->lo);
    to = fmin(to, task->hi);
    *walker = (struct mix_walker){.lo = 1, .hi = 0, .step = 1.0 / g->sigma};
    if (from > to) return;
    walker->lo = (uint32_t)from;
    walker->hi = (uint32_t)to;
    walker->d = (from - g->at) * walker->step;
    walker->value = g->peak * exp(-0.5 * walker->d * walker->d);
    walker->ratio = exp(-walker->step * (walker->d + 0.5 * walker->step));
    walker->change = exp(-walker->step * walker->step);
}

static void mix_next(struct mix_walker *walker)
{
    walker->value *= walker->ratio;
    walker->ratio *= walker->change;
    walker->d += walker->step;
}

/* What the model leaves of sample i. */
static double mix_rest(const struct finder_run *run, uint32_t i, double model)
{
    if (run->mark == NULL || run->mark[i] == FINDER_PLAIN) return run->y[i] - model;
    if (run->mark[i] == FINDER_BLIND) return 0.0;
    return fmax(0.0, run->finder->limit - model);
}

/* Adds a sample to the lower half of the normal equations: its derivatives are of the components in `active`. */
static void mix_add(const struct mix_walker *walker, const uint32_t *active, uint32_t n, double rest,
                    struct mix_normal *normal)
{
    double v[FINDER_MIX][3];
    for (uint32_t a = 0; a < n; a++) {
        const struct mix_walker *w = &walker[active[a]];
        const uint32_t row = 3 * active[a];
        v[a][0] = w->value;
        v[a][1] = w->value * w->d;
        v[a][2] = v[a][1] * w->d;
        for (uint32_t x = 0; x < 3; x++) {
            normal->r[row + x] += v[a][x] * rest;
            for (uint32_t b = 0; b <= a; b++)
                for (uint32_t y = 0; y < 3; y++)
                    normal->h[row + x][3 * active[b] + y] += v[a][x] * v[b][y];
        }
    }
}

/* A sigma is expected to be that of the pulse: within a factor of e^2, or of e^0.03 where the echo's top is not seen. So a
 * flank alone, which many pairs of peak and sigma explain, has one answer. */
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

/* The sum of squares that a mixture leaves, and the normal equations for its next step. */
static double mix_walk(const struct finder_task *task, const struct finder_mix *mix, struct mix_normal *normal)
{
    struct mix_walker walker[FINDER_MIX];
    double chi2 = 0.0;
    for (uint32_t j = 0; j < mix->n; j++)
        mix_begin(task, &mix->g[j], &walker[j]);
    for (uint32_t j = 0; j < 3 * mix->n; j++)
        memset(normal->h[j], 0, 3 * mix->n * sizeof normal->h[j][0]);
    memset(normal->r, 0, sizeof normal->r);
    for (uint32_t i = task->lo; i <= task->hi; i++) {
        uint32_t active[FINDER_MIX], n = 0;
        double model = 0.0;
        for (uint32_t j = 0; j < mix->n; j++)
            if (i >= walker[j].lo && i <= walker[j].hi) {
                active[n++] = j;
                model += walker[j].value;
            }
        double rest = mix_rest(task->run, i, model);
        chi2 += rest * rest;
        int counts = task->run->mark == NULL || task->run->mark[i] == FINDER_PLAIN || rest > 0.0;
        if (counts) mix_add(walker, active, n, rest, normal);
        for (uint32_t a = 0; a < n; a++)
            mix_next(&walker[active[a]]);
    }
    return chi2 + mix_expect(task, mix, normal);
}

/* Solves (h + damping diag h) p = r by Cholesky's decomposition. Returns 0 where that is not positive. */
static int mix_solve(const struct mix_normal *normal, uint32_t n, double damping, double p[MIX_MOST])
{
    double l[MIX_MOST][MIX_MOST];
    for (uint32_t i = 0; i < n; i++) {
        double right = normal->r[i];
        for (uint32_t j = 0; j <= i; j++) {
            double sum = normal->h[i][j];
            if (i == j) sum = sum * (1.0 + damping) + 1e-300;
            for (uint32_t k = 0; k < j; k++)
                sum -= l[i][k] * l[j][k];
            if (i == j && !(sum > 0.0)) return 0;
            l[i][j] = i == j ? sqrt(sum) : sum / l[j][j];
        }
        for (uint32_t k = 0; k < i; k++)
            right -= l[i][k] * p[k];
        p[i] = right / l[i][i];
    }
    for (uint32_t i = n; i-- > 0;) {
        for (uint32_t k = i + 1; k < n; k++)
            p[i] -= l[k][i] * p[k];
        p[i] /= l[i][i];
    }
    return 1;
}

static double mix_within(double x, double least, double most)
{
    return x < least ? least : x > most ? most : x;
}

/* A step, shortened: in one, a peak changes by at most a factor of e^2, a centre by 1.5 sigma. A centre stays among the
 * samples, unless the window ends there. */
static void mix_move(const struct finder_task *task, const double p[MIX_MOST], struct finder_mix *mix)
{
    const double h = task->run->finder->spread[0].sigma, room = task->hi - task->lo + 1.0;
    const double first = task->lo > 0 ? task->lo : -3.0 * h;
    const double last = task->hi + 1 < task->run->n ? task->hi : task->hi + 3.0 * h;
    for (uint32_t j = 0; j < mix->n; j++, p += 3) {
        struct finder_gaussian *g = &mix->g[j];
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
        if (gain <= 0.01 * task->variance && damping < 1.0) return;
        damping *= 0.15;
    }
}

void finder_mix_rest(const struct finder_task *task, const struct finder_mix *mix, double *rest)
{
    struct mix_walker walker[FINDER_MIX];
    for (uint32_t j = 0; j < mix->n; j++)
        mix_begin(task, &mix->g[j], &walker[j]);
    for (uint32_t i = task->lo; i <= task->hi; i++) {
        double model = 0.0;
        for (uint32_t j = 0; j < mix->n; j++)
            if (i >= walker[j].lo && i <= walker[j].hi) {
                model += walker[j].value;
                mix_next(&walker[j]);
            }
        rest[i - task->lo] = mix_rest(task->run, i, model);
    }
}
