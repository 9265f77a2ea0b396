/* SPDX-License-Identifier: MIT */
/* These detectors find an echo by its rising edge: where it crosses a fixed level, or a fraction of the peak.
 *
 * h is the pulse as it leaves the receiver (waveform.h). One sample lies on each side of the crossing. Divided by the
 * peak, a sample is a share of the peak. The table of h says how long before its centroid h rises through that share.
 * So each sample alone gives a place of the echo's centroid. This corrects the range walk, and an echo of h's
 * shape has no interpolation error. The result lies between both places, as the level lies between both samples. */
#include "core/waveform/detect_inside.h"

#include <math.h>

/* Returns the centroid, from the crossing of a level between sample k - 1 and sample k. */
static double edges_centroid(const struct finder_run *run, uint32_t k, double level, double peak)
{
    double above = k + finder_lead(run->finder, run->y[k] / peak);
    if (k == 0 || run->y[k - 1] < fmax(2.0 * run->finder->noise, 1e-5 * peak)) return above;
    double below = k - 1.0 + finder_lead(run->finder, run->y[k - 1] / peak);
    double u = (level - run->y[k - 1]) / (run->y[k] - run->y[k - 1]);
    return below + u * (above - below);
}

/* A top that is limited, or at either end of the window, has no peak to take a part of: its flanks are fitted. */
static int edges_hidden(const struct finder_run *run, const struct finder_peak *peak, struct finder_list *list)
{
    if (!finder_limited(run, peak) && peak->top > 0 && peak->top + 1 < run->n) return 0;
    struct finder_mix mix;
    finder_decompose(run, peak, 1, 0, &mix);
    finder_add_term(run, &mix, 0, list);
    return 1;
}

/* Another echo may begin only once the signal has been 5 sigma below the level: else noise on a slow tail would cross
 * the level again. Where the level is below 6 sigma, one sigma is low enough. Where the noise is larger than the level,
 * the sample at the crossing may itself be below `again`. That sample belongs to the echo all the same. */
void finder_threshold(const struct finder_run *run, struct finder_list *list)
{
    const double *y = run->y, at = run->finder->peak;
    const double again = fmax(at - 5.0 * run->finder->noise, run->finder->noise);
    for (uint32_t i = 0; i < run->n; i++) {
        if (y[i] < at) continue;
        const uint32_t cross = i;
        struct finder_peak peak = {i, i > 0 ? i - 1 : 0, 0};
        for (; i < run->n && (i == cross || y[i] >= again); i++)
            if (y[i] > y[peak.top]) peak.top = i;
        while (peak.from > 0 && y[peak.from] > 0.0)
            peak.from--;
        for (peak.to = i; peak.to < run->n && y[peak.to] > 0.0 && y[peak.to] < at;)
            peak.to++;
        if (edges_hidden(run, &peak, list)) continue;
        double place, height = finder_top(run, peak.top, &place), side[2];
        (void)finder_half(run, &peak, height, side);
        const struct finder_found found = {edges_centroid(run, cross, at, height), height, side[1] - side[0], 0};
        finder_add(run, &found, NULL, 0, list);
    }
}

void finder_fraction(const struct finder_run *run, struct finder_list *list)
{
    struct finder_peak peak[FINDER_PEAKS];
    const double at = run->finder->peak;
    uint32_t n = finder_peaks(run, 0.5 * at, peak, FINDER_PEAKS);
    if (n > FINDER_PEAKS) {
        list->crowded += n - FINDER_PEAKS;
        n = FINDER_PEAKS;
    }
    for (uint32_t i = 0; i < n; i++) {
        double place, height = finder_top(run, peak[i].top, &place), side[2];
        if (height < at || edges_hidden(run, &peak[i], list)) continue;
        (void)finder_half(run, &peak[i], height, side);
        struct finder_spread spread;
        finder_find(run->finder, FINDER_WIDTH, side[1] - side[0], &spread);
        const struct finder_found found = {side[0] + spread.half_lead, height, side[1] - side[0], 0};
        finder_add(run, &found, NULL, 0, list);
    }
}
