/* SPDX-License-Identifier: MIT */
/* This measures echoes found in samples: ns a pulse by detector beside the error of the ranges, on pulses that were
 * sampled before. Sampling has a row of its own. Figures are medians of the rounds, in processor time of the thread.
 *
 *   build/tests/bench/waveform_detect            a table
 *   build/tests/bench/waveform_detect --chart    rows of the chart's table (tests/bench/README.md)
 *
 * `single` is one return on a plane that is hit head on, `tilted` at 80 degrees, `pair` are two a pulse's width
 * apart, `foliage` is 40 returns over 3 m, `limited` is one 30 dB above the full scale, and `nothing` is noise.
 * `skew` is `single` with an asymmetric pulse, whose samples are 0.5 ns apart. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "core/rng.h"
#include "core/waveform.h"
#include "tests/bench/bench.h"
#include "tests/bench/pin.h"
#include "tests/common/wave_spec.h"

enum { PULSES = 2000, ROUNDS = 11, MOST_RETURNS = 40, MOST_ECHOES = 15, SAMPLES = 160, SCENES = 7 };
static const char *const SCENE[SCENES] = {"single", "tilted", "pair", "foliage", "limited", "nothing", "skew"};
static const char *const METHOD[3] = {"threshold", "fraction", "gaussians"};
static const double WIDTH_M = 0.6;

struct pulse {
    struct waveform_return part[MOST_RETURNS];
    uint32_t n;
    struct waveform_record record;
    uint16_t sample[SAMPLES];
};
static struct pulse pulses[PULSES];

static double even(uint64_t pulse, uint64_t which)
{
    return (double)(rng_u64(which * 977, pulse) >> 11) * 0x1p-53;
}

static void aim(int scene, uint64_t p, struct pulse *pulse)
{
    struct waveform_return *r = pulse->part;
    const double at_m = 60.0 + 40.0 * even(p, 1), amplitude = 10.0 + 50.0 * even(p, 2);
    pulse->n = 1;
    r[0] = (struct waveform_return){at_m, amplitude, 0.0, WAVEFORM_POINT};
    if (scene == 1) r[0] = (struct waveform_return){at_m, amplitude, 0.2, WAVEFORM_DISC};
    if (scene == 2)
        r[pulse->n++] = (struct waveform_return){at_m + WIDTH_M, 40.0 - 0.5 * amplitude, 0.0, WAVEFORM_POINT};
    if (scene == 3)
        for (pulse->n = 0; pulse->n < MOST_RETURNS; pulse->n++)
            r[pulse->n] = (struct waveform_return){at_m + 3.0 * even(p, 10 + pulse->n), 4.0 * even(p, 90 + pulse->n),
                                                   0.0, WAVEFORM_POINT};
    if (scene == 4) r[0].amplitude = 1e5;
    if (scene == 5) pulse->n = 0;
}

static struct waveform *make(int scene)
{
    struct waveform_spec spec = wave_spec();
    spec.before_s = spec.after_s = 25e-9;
    if (scene == 5) {
        spec.near_m = 60.0;
        spec.far_m = 69.5;
    }
    if (scene == 6) {
        spec.shape = WAVEFORM_ASYMMETRIC;
        spec.skew = 2.0;
        spec.sample_s = 0.5e-9;
    }
    struct waveform *waveform = NULL;
    struct sh_err err;
    if (waveform_create(&spec, &waveform, &err) != SH_OK) fprintf(stderr, "waveform_detect: %s\n", err.text);
    return waveform;
}

static double sample_all(const struct waveform *waveform)
{
    double from = bench_thread_s();
    for (uint64_t p = 0; p < PULSES; p++) {
        pulses[p].record.sample = pulses[p].sample;
        pulses[p].record.capacity = SAMPLES;
        waveform_sample(waveform, 0, p, pulses[p].part, pulses[p].n, &pulses[p].record);
    }
    return 1e9 * (bench_thread_s() - from) / PULSES;
}

struct figures {
    double ns, rms_m, p999_m, max_m, echoes;
};

/* Errors are those of echoes from the nearest return; in foliage no return has an echo of its own. */
static void judge(int scene, uint64_t echoes, double *off, uint32_t n, struct figures *f)
{
    double sum = 0.0;
    f->echoes = (double)echoes / PULSES;
    if (n == 0 || scene == 3) return;
    bench_sort(off, n);
    for (uint32_t i = 0; i < n; i++)
        sum += off[i] * off[i];
    f->rms_m = sqrt(sum / n);
    f->p999_m = off[(uint32_t)(0.999 * (n - 1))];
    f->max_m = off[n - 1];
}

static double nearest_m(const struct pulse *pulse, double range_m)
{
    double best = INFINITY;
    for (uint32_t k = 0; k < pulse->n; k++)
        best = fmin(best, fabs(range_m - pulse->part[k].range_m));
    return best;
}

static void measure(const struct waveform *waveform, int scene, enum waveform_detector detector, struct figures *f)
{
    static double off[PULSES * MOST_ECHOES];
    struct waveform_echo echo[MOST_ECHOES];
    double ns[ROUNDS];
    uint64_t echoes = 0;
    uint32_t n_off = 0, crowded = 0;
    memset(f, 0, sizeof *f);
    for (int round = 0; round < ROUNDS; round++) {
        double from = bench_thread_s();
        for (uint32_t p = 0; p < PULSES; p++)
            (void)waveform_detect(waveform, detector, &pulses[p].record, echo, MOST_ECHOES, &crowded);
        ns[round] = 1e9 * (bench_thread_s() - from) / PULSES;
    }
    for (uint32_t p = 0; p < PULSES; p++) {
        uint32_t n = waveform_detect(waveform, detector, &pulses[p].record, echo, MOST_ECHOES, &crowded);
        echoes += n;
        for (uint32_t i = 0; i < n; i++)
            off[n_off++] = nearest_m(&pulses[p], echo[i].range_m);
    }
    f->ns = bench_median(ns, ROUNDS);
    judge(scene, echoes, off, n_off, f);
}

static void print_table(int scene, double sampling_ns, const struct figures f[3])
{
    printf("%-10s %-10s %9.0f  (%u samples)\n", SCENE[scene], "sampling", sampling_ns, pulses[0].record.n_samples);
    for (int m = 0; m < 3; m++)
        printf("%-10s %-10s %9.0f %7.2f %8.2f %9.2f %7.2f\n", SCENE[scene], METHOD[m], f[m].ns, f[m].echoes,
               1e3 * f[m].rms_m, 1e3 * f[m].p999_m, 1e3 * f[m].max_m);
}

/* A row is on the front unless another one is no worse in cost and in both errors. Foliage and noise have no errors. */
static void print_rows(int scene, const struct figures f[3])
{
    for (int m = 0; m < 3 && scene != 3 && scene != 5; m++) {
        int front = 1;
        for (int k = 0; k < 3; k++)
            if (k != m && f[k].ns <= f[m].ns && f[k].p999_m <= f[m].p999_m && f[k].max_m <= f[m].max_m) front = 0;
        printf("detection,%s,%s,%.3f,%.3g,%.3g,%d,%d,%.3g,\n", METHOD[m], SCENE[scene], f[m].ns, f[m].p999_m,
               f[m].max_m, front, m == WAVEFORM_GAUSSIANS, f[m].rms_m);
    }
}

int main(int argc, char **argv)
{
    const int chart = argc > 1 && strcmp(argv[1], "--chart") == 0;
    pin(NULL);
    if (!chart) printf("scene      method      ns/pulse  echoes   rms mm  p99.9 mm  max mm\n");
    for (int scene = 0; scene < SCENES; scene++) {
        struct waveform *waveform = make(scene);
        double ns[ROUNDS];
        struct figures f[3];
        if (waveform == NULL) return 1;
        for (uint64_t p = 0; p < PULSES; p++)
            aim(scene, p, &pulses[p]);
        for (int round = 0; round < ROUNDS; round++)
            ns[round] = sample_all(waveform);
        for (int m = 0; m < 3; m++)
            measure(waveform, scene, (enum waveform_detector)m, &f[m]);
        if (chart)
            print_rows(scene, f);
        else
            print_table(scene, bench_median(ns, ROUNDS), f);
        waveform_free(waveform);
    }
    return 0;
}
