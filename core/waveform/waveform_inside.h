/* SPDX-License-Identifier: MIT */
/* Private: a waveform's tables, and the steps from returns to samples. Times are counted in samples of the digitiser, or
 * in steps, which are sample_s / phases. */
#ifndef CORE_WAVEFORM_WAVEFORM_INSIDE_H
#define CORE_WAVEFORM_WAVEFORM_INSIDE_H

#include <stdint.h>

#include "core/waveform.h"

/* h in steps. Step i is h[i % phases * pitch + i / phases], so that all samples of a pulse, which lie whole samples apart,
 * read neighbours. The first 4 steps are 0, and so is the last entry of each row. */
struct waveform_pulse {
    double *h;
    uint32_t phases, length, pitch; /* pitch = length + 1 */
    double centroid;                /* in steps */
    double lead, lag;               /* its first and last sample, before and after the centroid */
    double scale;                   /* in samples: sigma of a Gaussian as short as the shortest that is in h */
    double area_s;
};
/* Where the spec's limits are kept. Frees nothing on failure: waveform_pulse_free. */
int waveform_pulse_make(const struct waveform_spec *spec, struct waveform_pulse *pulse, struct sh_err *err);
void waveform_pulse_free(struct waveform_pulse *pulse);

/* How energy spreads, as nodes with weights of sum 1. Level k has its own nodes, enough up to extents of reach[k] times
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
};
int waveform_rule_make(enum waveform_spread spread, struct waveform_rule *rule, struct sh_err *err);
void waveform_rule_free(struct waveform_rule *rule);

struct waveform {
    struct waveform_spec spec; /* with a table of its own */
    double *table;
    struct waveform_pulse pulse;
    struct waveform_rule disc, bell;
    double samples_1_m;               /* of range */
    double counts_1;                  /* of a signal of 1 */
    int64_t before, after, dead;      /* in samples */
    int64_t gate_begin, gate_end;     /* 0 and 0: none */
    uint64_t key;
};

int waveform_check(const struct waveform_spec *spec, struct sh_err *err);
/* Adds a return whose centroid lies `centre` samples after signal[0]. */
void waveform_add(const struct waveform *waveform, const struct waveform_return *part, double centre, uint32_t n,
                  double *signal);
/* How far a return reaches about its centroid beyond the pulse itself, in samples. */
double waveform_reach(const struct waveform *waveform, const struct waveform_return *part);
/* Counts of samples first .. first + n of a pulse, whose key is pulse_key. */
void waveform_digitise(const struct waveform *waveform, uint64_t pulse_key, int64_t first, uint32_t n,
                       const double *signal, uint16_t *count);

#endif
