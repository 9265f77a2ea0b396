/* SPDX-License-Identifier: MIT */
/* This measures what the samples of a pulse cost, in processor time of the thread, medians of the rounds.
 *
 *   build/tests/bench/waveform            ns a pulse by spread and window, with and without noise
 *   build/tests/bench/waveform --chart    rows of the chart's table: methods for a footprint, against 100,000 sub-rays,
 *                                         with errors in counts of 12 bits in place of metres */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "tests/bench/bench.h"
#include "tests/bench/pin.h"
#include "tests/common/waveform_reference.h"

enum { ROUNDS = 21, MOST_SAMPLES = 16 * WAVEFORM_MAX_SAMPLES };

static uint16_t sample[MOST_SAMPLES];

static struct waveform *open_waveform(const struct waveform_spec *spec)
{
    struct waveform *w;
    struct sh_err err;
    if (waveform_create(spec, &w, &err) == SH_OK) return w;
    fprintf(stderr, "waveform: %s\n", err.text);
    exit(1);
}

/* Returns move a little from pulse to pulse, so that they lie everywhere between the samples. */
static double cost_ns(const struct waveform *w, struct waveform_return *r, uint32_t n, double *samples)
{
    const uint32_t pulses = 40000 / (n + 3);
    double ns[ROUNDS];
    struct waveform_record record = {.sample = sample, .capacity = MOST_SAMPLES};
    *samples = 0.0;
    for (int round = 0; round < ROUNDS; round++) {
        const double start_s = bench_thread_s();
        for (uint32_t k = 0; k < pulses; k++) {
            r[0].range_m += k % 2 == 0 ? 0.0137 : -0.0137;
            waveform_sample(w, 0, k, r, n, &record);
            *samples += (double)record.n_samples / ROUNDS / pulses;
        }
        ns[round] = 1e9 * (bench_thread_s() - start_s) / pulses;
    }
    return bench_median(ns, ROUNDS);
}

static void by_window(void)
{
    static const char *const spreads[] = {"point", "disc", "bell"};
    static const double extents[] = {0.1, 0.3, 1.0, 3.0, 10.0};
    static const uint32_t windows[] = {32, 64, 128, 256};
    struct waveform_spec spec = waveref_spec();
    spec.keep = 1.0;
    spec.full_scale = 1000.0;
    spec.saturation = 900.0;
    spec.baseline_counts = 100.0;
    for (int k = 0; k < 11; k++)
        for (int noisy = 0; noisy < 2; noisy++) {
            const enum waveform_spread spread = k == 0 ? WAVEFORM_POINT : k < 6 ? WAVEFORM_DISC : WAVEFORM_BELL;
            const double extent = k == 0 ? 0.0 : extents[(k - 1) % 5];
            printf("%-5s of %4.1f pulse sigmas, %-8s", spreads[spread], extent, noisy ? "noise:" : "no noise:");
            for (int i = 0; i < 4; i++) {
                struct waveform_return r = {50.0, 100.0, extent * WAVEREF_SIGMA_S * WAVEREF_METRES_1_S, spread};
                double samples;
                spec.noise = noisy ? 0.125 : 0.0;
                spec.before_s = spec.after_s = 0.5e-9 * windows[i] - 3e-9;
                struct waveform *w = open_waveform(&spec);
                double ns = cost_ns(w, &r, 1, &samples);
                printf("  %4.0f ns a pulse of %3.0f samples", ns, samples);
                waveform_free(w);
            }
            printf("\n");
        }
}

/* One method on one shape; errors in counts. */
struct row {
    char method[32];
    int is_default;
    double ns, p999, most, rms;
};

static struct row measure(const struct waveform *w, struct waveform_return *r, uint32_t n,
                          const struct waveref_window *reference)
{
    static struct waveref_window ours;
    double off[WAVEREF_SAMPLES], peak = 0.0, samples;
    waveref_fill(w, r, n, reference, &ours);
    for (uint32_t i = 0; i < ours.n; i++)
        peak = fmax(peak, reference->p[i]);
    for (uint32_t i = 0; i < ours.n; i++)
        off[i] = 4095.0 / peak * fabs(ours.p[i] - reference->p[i]);
    bench_sort(off, ours.n);
    return (struct row){.ns = cost_ns(w, r, n, &samples),
                        .p999 = off[(uint32_t)(0.999 * (ours.n - 1))],
                        .most = off[ours.n - 1],
                        .rms = waveref_counts(&ours, reference)};
}

/* A row is on the front unless another one is no worse in cost and RMS, and better in one of them. */
static void print_rows(const char *shape, const struct row *row, int n)
{
    for (int i = 0; i < n; i++) {
        const struct row *a = &row[i];
        int front = 1;
        for (int k = 0; k < n; k++)
            if (row[k].ns <= a->ns && row[k].rms <= a->rms && (row[k].ns < a->ns || row[k].rms < a->rms)) front = 0;
        printf("waveform,%s,%s,%.1f,%.3g,%.3g,%d,%d,%.3g,\n", a->method, shape, a->ns, a->p999, a->most, front,
               a->is_default, a->rms);
        fprintf(stderr, "chart: waveform, %-12s %-12s %9.1f ns a pulse, RMS %.3f counts, at most %.3f\n", shape,
                a->method, a->ns, a->rms, a->most);
    }
}

static void by_method(void)
{
    static const uint32_t rings[] = {1, 2, 4, 6, 18};
    static struct waveform_return r[BEAM_SUBRAY_ROOM];
    static struct waveref_window reference;
    struct waveform_spec spec = waveref_spec();
    spec.noise = 1e-3;
    struct waveform *w = open_waveform(&spec);
    for (int shape = 0; shape < WAVEREF_SHAPES; shape++) {
        struct row row[6];
        int rows = 0;
        waveref_by_rays(&waveref_shape[shape], &reference);
        uint32_t n = waveref_parts(shape, r);
        if (n > 0) {
            row[rows] = measure(w, r, n, &reference);
            row[rows].is_default = 1;
            snprintf(row[rows++].method, sizeof row->method, n == 1 ? "closed form" : "parts");
        }
        for (int i = 0; i < 5; i++) {
            n = waveref_rings(&waveref_shape[shape], rings[i], r);
            row[rows] = measure(w, r, n, &reference);
            row[rows].is_default = n == 61 && rows == i; /* the rings of beam.mode where nothing else fits */
            snprintf(row[rows++].method, sizeof row->method, "rings %u", n);
        }
        print_rows(waveref_shape[shape].name, row, rows);
    }
    waveform_free(w);
}

int main(int argc, char **argv)
{
    pin(NULL);
    if (argc > 1 && strcmp(argv[1], "--chart") == 0)
        by_method();
    else
        by_window();
    return fflush(stdout) == 0 ? 0 : 1;
}
