/* SPDX-License-Identifier: MIT */
/* This private header has a waveform's tables, and the steps from returns to samples. Times are counted in samples
 * of the digitiser, or in steps, which are sample_s / phases. */
#ifndef CORE_WAVEFORM_WAVEFORM_INSIDE_H
#define CORE_WAVEFORM_WAVEFORM_INSIDE_H

#include <stdint.h>

#include "core/waveform.h"
#include "core/waveform/detect_inside.h"

/* h in steps. Step i is h[i % phases * pitch + i / phases]: steps that are a whole sample apart lie side by side. So
 * successive samples of a pulse read neighbours. The first 4 steps are 0, and so is the last entry of each row. */
struct waveform_pulse {
    double *h;
    uint32_t phases, length, pitch; /* pitch = length + 1 */
    double lead, lag;               /* from its first step to the centroid, from there to its last one; in samples */
    double scale; /* in samples, at least 0.3: sigma of the Gaussian whose spectrum falls to 1e-5 where h's does */
    double area_s;
};
/* Makes the pulse of a spec. The caller has checked the spec's limits, and scaled its table to a peak of 1. Also after
 * an error, waveform_pulse_free is to be called. */
int waveform_pulse_make(const struct waveform_spec *spec, struct waveform_pulse *pulse, struct sh_err *err);
void waveform_pulse_free(struct waveform_pulse *pulse);

/* Energy spreads over nodes with weights of sum 1. Level k has its own nodes, enough up to extents of reach[k] times
 * the pulse's scale. */
enum { WAVEFORM_LEVELS = 18, WAVEFORM_MOST_NODES = 2048 };
#define WAVEFORM_BELL_END 4.8 /* standard deviations: 1.6e-6 of the energy lies beyond */
struct waveform_node {
    double x, weight;
};
struct waveform_rule {
    struct waveform_node *node;
    uint32_t first[WAVEFORM_LEVELS + 1];
    double reach[WAVEFORM_LEVELS];
    double square; /* mean of x^2 */
};
int waveform_rule_make(enum waveform_spread spread, struct waveform_rule *rule, struct sh_err *err);
void waveform_rule_free(struct waveform_rule *rule);

/* A count is baseline + counts_1 * (min(signal, most) + noise), from 0 to top. */
struct waveform_digits {
    double baseline, counts_1, noise, most, top;
};

struct waveform {
    struct waveform_spec spec; /* with a table of its own */
    double *table;
    struct waveform_pulse pulse;
    struct waveform_rule disc, bell;
    double samples_1_m; /* of range */
    struct waveform_digits digits;
    int64_t before, after, dead;  /* in samples */
    int64_t gate_begin, gate_end; /* 0 and 0: none */
    uint64_t key;
    struct finder finder;
};

int waveform_check(const struct waveform_spec *spec, struct sh_err *err);
/* Adds a return whose centroid lies `centre` samples after signal[0]. */
void waveform_add(const struct waveform *waveform, const struct waveform_return *part, double centre, uint32_t n,
                  double *signal);
/* Returns how far a return reaches about its centroid beyond the pulse itself, in samples. */
double waveform_reach(const struct waveform *waveform, const struct waveform_return *part);

#endif
