/* SPDX-License-Identifier: MIT */
/* Finds echoes in a pulse's samples. First counts become signals. Then one of the detectors searches each window. The
 * detector `gaussians` is in this file: it finds maxima, and decomposes those that run into each other together. */
#include "core/waveform/detect_inside.h"

#include <math.h>
#include <string.h>

#include "core/light.h"
#include "core/waveform/waveform_inside.h"

/* Computes the signals of a window's samples. Returns the largest. */
static double detect_signals(const struct finder *finder, double baseline, const uint16_t *sample, uint32_t n,
                             double *y)
{
    uint16_t most = 0;
    for (uint32_t i = 0; i < n; i++)
        most = sample[i] > most ? sample[i] : most;
    for (uint32_t i = 0; i < n; i++)
        y[i] = ((double)sample[i] - baseline) * finder->signal;
    return ((double)most - baseline) * finder->signal;
}

/* Marks samples that are limited, and those in which the receiver is blind. *until: number on the pulse's grid of
 * the first sample that is not blind any more; the number goes on from window to window. A receiver that has not
 * saturated shows a signal right after the last limited sample. Then only the digitiser's range was exceeded, and the
 * receiver is not blind. */
static void detect_mark(const struct finder *finder, const struct waveform_window *window, double *y, uint8_t *mark,
                        uint32_t *until)
{
    for (uint32_t i = 0; i < window->n; i++) {
        mark[i] = FINDER_PLAIN;
        if (y[i] >= finder->limit) {
            mark[i] = FINDER_LIMITED;
            *until = window->first + i + 1 + finder->blind;
        } else if (i > 0 && mark[i - 1] == FINDER_LIMITED && y[i] > 5.0 * finder->noise) {
            *until = 0;
        } else if (window->first + i < *until) {
            mark[i] = FINDER_BLIND;
            if (i > 0) y[i] = y[i - 1];
        }
    }
}

/* A maximum has to stand out by 15 %: within the echo of one plane no second maximum does. A maximum also has to stand
 * out by 6.5 sigma: the noise of 20 samples spans more than that once in 1,000. */
static double detect_prominence(const struct finder *finder, double y)
{
    return fmax(6.5 * finder->noise, 0.15 * y);
}

/* Where the signal is within a sigma of zero, an echo has ended, however weak it was, and another may begin. */
static int detect_fell(const struct finder *finder, double high, double y)
{
    return y < fmax(high - detect_prominence(finder, high), finder->noise);
}

static int detect_rose(const struct finder *finder, double low, double y, double least)
{
    return y > low + detect_prominence(finder, y) || (low < finder->noise && y >= least);
}

uint32_t finder_peaks(const struct finder_run *run, double least, struct finder_peak *peak, uint32_t most)
{
    uint32_t n = 0, top = 0, valley = 0;
    int rising = 1;
    for (uint32_t i = 0; i < run->n; i++) {
        const double y = run->y[i];
        if (rising) {
            if (y > run->y[top]) top = i;
            if (i + 1 < run->n && !detect_fell(run->finder, run->y[top], y)) continue;
            rising = 0;
            /* After a blind start of a window the signal falls: its maximum was not seen. */
            int hidden =
                run->mark != NULL && top > 0 && run->mark[top] != FINDER_LIMITED && run->mark[top - 1] == FINDER_BLIND;
            if (run->y[top] >= least && !hidden) {
                if (n < most) peak[n] = (struct finder_peak){top, valley, run->n};
                if (n > 0 && n < most) peak[n - 1].to = valley + 1;
                n++;
            }
            valley = i;
        } else if (y <= run->y[valley]) {
            valley = i;
        } else if (detect_rose(run->finder, run->y[valley], y, least)) {
            rising = 1;
            top = i;
        }
    }
    return n;
}

/* The parabola through the logarithms of three samples is exact for a Gaussian. Where pulses are short compared with
 * the time between samples, noise may make a neighbour zero or less: it counts as 2 % of the top. A neighbour above the
 * top is noise, too: then no parabola is used, since its top may be anywhere. */
double finder_top(const struct finder_run *run, uint32_t top, double *place)
{
    const double y = run->y[top], least = 0.02 * y;
    *place = top;
    if (top == 0 || top + 1 == run->n) return y;
    double a = log(fmax(run->y[top - 1], least) / y), b = log(fmax(run->y[top + 1], least) / y);
    double bend = a + b, slope = b - a;
    if (a > 0.0 || b > 0.0 || !(bend < 0.0)) return y;
    *place -= 0.5 * slope / bend;
    return y * exp(-0.125 * slope * slope / bend);
}

/* Returns the crossing of a level between sample a, which is below it, and its neighbour b, which is not. Near half
 * of the peak a Gaussian bends by 0.193 of its peak over sigma^2 (v^2 - 1 at v^2 = 2 ln 2, times a half). */
static double detect_crossing(const double *y, uint32_t a, uint32_t b, double level, double bend)
{
    double step = y[b] - y[a], u = (level - y[a]) / step;
    u = fmin(1.0, u + 0.5 * u * (1.0 - u) * bend / step);
    return (double)a + u * ((double)b - (double)a);
}

/* A spike that is no echo may rise and fall within a sample. Such a spike's width counts as half a sample. */
int finder_half(const struct finder_run *run, const struct finder_peak *peak, double height, double side[2])
{
    const double level = 0.5 * height;
    uint32_t a = peak->top, b = peak->top;
    while (a > peak->from && run->y[a] >= level)
        a--;
    while (b + 1 < peak->to && run->y[b] >= level)
        b++;
    int left = run->y[a] < level, right = run->y[b] < level;
    double sigma = fmax(((double)b - (double)a - 1.0) / FINDER_FWHM, 0.4), bend = 0.193 * height / (sigma * sigma);
    if (left) side[0] = detect_crossing(run->y, a, a + 1, level, bend);
    if (right) side[1] = detect_crossing(run->y, b, b - 1, level, bend);
    double place;
    if (left + right < 2) (void)finder_top(run, peak->top, &place);
    if (!left) side[0] = right ? fmin(2.0 * place - side[1], place) : (double)a;
    if (!right) side[1] = left ? fmax(2.0 * place - side[0], place) : (double)b;
    if (side[1] - side[0] < 0.5) side[1] = (side[0] = 0.5 * (side[0] + side[1]) - 0.25) + 0.5;
    return left + right;
}

/* Maxima are one mixture where the signal between them stays above noise, and above 2 % of the smaller one. */
static int detect_joined(const struct finder_run *run, const struct finder_peak *before,
                         const struct finder_peak *after)
{
    double smaller = fmin(run->y[before->top], run->y[after->top]);
    return run->y[after->from] > fmax(3.0 * run->finder->noise, 0.02 * smaller);
}

static void detect_gaussians(const struct finder_run *run, struct finder_list *list)
{
    struct finder_peak peak[FINDER_PEAKS];
    const struct finder *finder = run->finder;
    /* Noise may lower all samples of an echo that just reaches the level, and the largest lies half a sample from its
     * top. */
    const double least = fmax(finder->peak - 3.0 * finder->noise, 0.5 * finder->peak);
    uint32_t n = finder_peaks(run, least, peak, FINDER_PEAKS), end;
    if (n > FINDER_PEAKS) {
        list->crowded += n - FINDER_PEAKS;
        n = FINDER_PEAKS;
    }
    for (uint32_t i = 0; i < n; i = end) {
        struct finder_mix mix = {.n = 1};
        for (end = i + 1; end < n && end - i < FINDER_MIX && detect_joined(run, &peak[end - 1], &peak[end]);)
            end++;
        if (end > i + 1 || finder_limited(run, &peak[i]) || !finder_fit(run, &peak[i], &mix.g[0]))
            finder_decompose(run, &peak[i], end - i, 1, &mix);
        for (uint32_t j = 0; j < mix.n; j++)
            finder_add_term(run, &mix, j, list);
    }
}

/* Keeps echoes of all detectors in the order of range. Where there is no room, the weakest is left out. */
static void detect_insert(struct finder_list *list, const struct waveform_echo *echo)
{
    if (list->n == list->most) {
        list->crowded++;
        uint32_t weakest = 0;
        for (uint32_t i = 1; i < list->n; i++)
            if (list->echo[i].amplitude < list->echo[weakest].amplitude) weakest = i;
        if (list->n == 0 || list->echo[weakest].amplitude >= echo->amplitude) return;
        list->n--;
        memmove(list->echo + weakest, list->echo + weakest + 1, (list->n - weakest) * sizeof *echo);
    }
    uint32_t at = list->n++;
    for (; at > 0 && list->echo[at - 1].range_m > echo->range_m; at--)
        list->echo[at] = list->echo[at - 1];
    list->echo[at] = *echo;
}

static double detect_others(const struct finder *finder, const struct finder_mix *mix, uint32_t self, double x)
{
    double sum = 0.0;
    for (uint32_t j = 0; mix != NULL && j < mix->n; j++) {
        double d = (x - mix->g[j].at) / mix->g[j].sigma;
        if (j != self) sum += mix->g[j].peak * finder_value(finder, d);
    }
    return sum;
}

/* Returns the RMS of the difference between samples and expected signal, divided by the echo's peak. The expected
 * signal is the pulse's shape (h of core/waveform.h) with the echo's peak, plus the other terms of its mixture. The
 * samples are those within the echo's width on both sides of its centroid. */
static double detect_deviation(const struct finder_run *run, const struct finder_found *found,
                               const struct finder_mix *mix, uint32_t self)
{
    double lo = fmax(0.0, ceil(found->at - found->width)), hi = fmin(run->n - 1.0, floor(found->at + found->width));
    double sum = 0.0;
    uint32_t n = 0;
    const double per_width = 1.0 / run->finder->width;
    const int alone = mix == NULL || mix->n == 1;
    for (double x = lo; x <= hi; x += 1.0) {
        uint32_t i = (uint32_t)x;
        if (run->mark != NULL && run->mark[i] != FINDER_PLAIN) continue;
        double rest = run->y[i] - found->peak * finder_table(run->finder->shape, (x - found->at) * per_width);
        if (!alone) rest -= detect_others(run->finder, mix, self, x);
        sum += rest * rest;
        n++;
    }
    return n > 0 ? sqrt(sum / n) / found->peak : 0.0;
}

void finder_add(const struct finder_run *run, const struct finder_found *found, const struct finder_mix *mix,
                uint32_t self, struct finder_list *list)
{
    const struct finder *finder = run->finder;
    const struct waveform_echo echo = {
        .range_m = (run->first + found->at) * finder->metre,
        .amplitude = found->peak / finder->peak,
        .width_s = found->width * 2.0 * finder->metre / LIGHT_SPEED_M_S,
        .deviation = detect_deviation(run, found, mix, self),
        .saturated = found->saturated,
    };
    detect_insert(list, &echo);
}

void finder_add_term(const struct finder_run *run, const struct finder_mix *mix, uint32_t self,
                     struct finder_list *list)
{
    const struct finder_term *g = &mix->g[self];
    const double level = run->finder->peak;
    struct finder_spread spread;
    finder_find(run->finder, FINDER_SIGMA, g->sigma, &spread);
    struct finder_found found = {g->at - spread.lag, g->peak * spread.gain, spread.width,
                                 (int)(mix->limited >> self & 1)};
    if (mix->seen >> self & 1) found.peak = fmax(found.peak, level);
    if (found.peak >= level) finder_add(run, &found, mix, self, list);
}

uint32_t waveform_detect(const struct waveform *waveform, enum waveform_detector detector,
                         const struct waveform_record *record, struct waveform_echo *echoes, uint32_t most,
                         uint32_t *n_crowded)
{
    const struct finder *finder = &waveform->finder;
    const double baseline = waveform_spec_of(waveform)->baseline_counts;
    struct finder_list list = {.echo = echoes, .most = most};
    double y[WAVEFORM_MAX_SAMPLES];
    uint8_t mark[WAVEFORM_MAX_SAMPLES];
    uint32_t until = 0;
    for (uint32_t w = 0; w < record->n_windows && finder->seen; w++) {
        const struct waveform_window *window = &record->window[w];
        struct finder_run run = {finder, y, window->n, NULL, window->first};
        double top = detect_signals(finder, baseline, record->sample + window->at, window->n, y);
        if (top >= finder->limit || window->first < until) {
            detect_mark(finder, window, y, mark, &until);
            run.mark = mark;
        }
        if (top < 0.5 * finder->peak) continue;
        if (detector == WAVEFORM_THRESHOLD) finder_threshold(&run, &list);
        if (detector == WAVEFORM_FRACTION) finder_fraction(&run, &list);
        if (detector == WAVEFORM_GAUSSIANS) detect_gaussians(&run, &list);
    }
    *n_crowded += list.crowded;
    return list.n;
}
