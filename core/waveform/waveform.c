/* SPDX-License-Identifier: MIT */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/light.h"
#include "core/rng.h"
#include "core/waveform/waveform_inside.h"

/* Returns how many samples cover a time. A time that was meant as whole samples may be longer by a rounding error. */
static int64_t samples_of(double time_s, double sample_s)
{
    return (int64_t)ceil(time_s / sample_s - 1e-6);
}

static void set_up_digits(struct waveform *w)
{
    const struct waveform_spec *s = &w->spec;
    w->samples_1_m = 2.0 / (LIGHT_SPEED_M_S * s->sample_s);
    w->digits.top = (double)(1U << s->bits) - 1.0;
    w->digits.baseline = s->baseline_counts;
    w->digits.counts_1 = (w->digits.top - s->baseline_counts) / s->full_scale;
    w->digits.noise = s->noise;
    w->digits.most = s->saturation > 0.0 ? s->saturation : (double)INFINITY;
    w->before = samples_of(s->before_s, s->sample_s);
    w->after = samples_of(s->after_s, s->sample_s);
    w->dead = samples_of(s->dead_s, s->sample_s);
    if (s->near_m < s->far_m) {
        w->gate_begin = (int64_t)ceil(s->near_m * w->samples_1_m);
        w->gate_end = (int64_t)floor(s->far_m * w->samples_1_m) + 1;
    }
    w->key = rng_key(s->seed, RNG_WAVEFORM);
}

static int copy_table(struct waveform *w, struct sh_err *err)
{
    const size_t size = w->spec.n_table * sizeof *w->table;
    w->table = malloc(size);
    if (w->table == NULL) return sh_fail(err, SH_ENOMEM, "waveform: no memory");
    memcpy(w->table, w->spec.table, size);
    double most = 0.0;
    for (uint32_t i = 0; i < w->spec.n_table; i++)
        most = fmax(most, w->table[i]);
    for (uint32_t i = 0; i < w->spec.n_table; i++)
        w->table[i] /= most;
    w->spec.table = w->table;
    return SH_OK;
}

int waveform_create(const struct waveform_spec *spec, struct waveform **out, struct sh_err *err)
{
    *out = NULL;
    int rc = waveform_check(spec, err);
    if (rc != SH_OK) return rc;
    struct waveform *w = calloc(1, sizeof *w);
    if (w == NULL) return sh_fail(err, SH_ENOMEM, "waveform: no memory");
    w->spec = *spec;
    if (spec->shape == WAVEFORM_TABLE) rc = copy_table(w, err);
    if (rc == SH_OK) rc = waveform_pulse_make(&w->spec, &w->pulse, err);
    if (rc == SH_OK) rc = waveform_rule_make(WAVEFORM_DISC, &w->disc, err);
    if (rc == SH_OK) rc = waveform_rule_make(WAVEFORM_BELL, &w->bell, err);
    if (rc != SH_OK) {
        waveform_free(w);
        return rc;
    }
    set_up_digits(w);
    finder_learn(w, &w->finder);
    *out = w;
    return SH_OK;
}

void waveform_free(struct waveform *w)
{
    if (w == NULL) return;
    waveform_pulse_free(&w->pulse);
    waveform_rule_free(&w->disc);
    waveform_rule_free(&w->bell);
    free(w->table);
    free(w);
}

double waveform_pulse_area_s(const struct waveform *w)
{
    return w->pulse.area_s;
}

double waveform_pulse_peak(const struct waveform *w)
{
    return w->finder.peak;
}

int waveform_check_detection(const struct waveform *w, struct sh_err *err)
{
    if (w->finder.seen) return SH_OK;
    return sh_fail(err, SH_EINPUT,
                   "echoes are not found with this pulse: its largest power is too far from its centroid; allowed is "
                   "%g widths before to %g after it",
                   FINDER_SHAPE_LEAD - 1.0, FINDER_SHAPE_LAG - 1.0);
}

const struct waveform_spec *waveform_spec_of(const struct waveform *w)
{
    return &w->spec;
}

double waveform_signal(const struct waveform *w, const struct waveform_return *returns, uint32_t n, double r_m)
{
    double signal = 0.0;
    for (uint32_t i = 0; i < n; i++)
        waveform_add(w, &returns[i], (returns[i].range_m - r_m) * w->samples_1_m, 1, &signal);
    return signal;
}
