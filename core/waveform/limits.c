/* SPDX-License-Identifier: MIT */
/* A spec is checked against its limits here. */
#include <math.h>
#include <stddef.h>

#include "core/digits.h"
#include "core/light.h"
#include "core/waveform/waveform_inside.h"

enum { ASYMMETRIC = 1 << WAVEFORM_ASYMMETRIC, TABLE = 1 << WAVEFORM_TABLE, ALL = 7, FORMULA = ALL & ~TABLE };

/* The limits low .. high are in SI. Texts show them in `unit`, which is SI times `scale`. */
struct limit {
    const char *what, *unit;
    size_t at;
    double low, high, scale;
    int shapes, or_zero;
};

#define AT(member) offsetof(struct waveform_spec, member)
/* clang-format off */
static const struct limit limits[] = {
    {"a pulse's width",             "ns",                  AT(width_s),      1e-11, 1e-6, 1e9,  FORMULA,    0},
    {"a pulse's fall/rise ratio",   "times",               AT(skew),         1.0,   3.0,  1.0,  ASYMMETRIC, 0},
    {"the step of a pulse's table", "ns",                  AT(table_step_s), 1e-12, 1e-7, 1e9,  TABLE,      0},
    {"a receiver's bandwidth",      "MHz",                 AT(bandwidth_hz), 1e6,   1e11, 1e-6, ALL,        1},
    {"the time between samples",    "ns",                  AT(sample_s),     5e-11, 1e-7, 1e9,  ALL,        0},
    {"the largest count's signal",  "times the threshold", AT(full_scale),   1e-3,  1e9,  1.0,  ALL,        0},
    {"the signal that saturates",   "times the threshold", AT(saturation),   1e-3,  1e9,  1.0,  ALL,        1},
    {"a dead time",                 "ns",                  AT(dead_s),       0.0,   1e-3, 1e9,  ALL,        0},
    {"noise",                       "times the threshold", AT(noise),        0.0,   1e6,  1.0,  ALL,        0},
    {"time kept before an echo",    "ns",                  AT(before_s),     0.0,   1e-5, 1e9,  ALL,        0},
    {"time kept after an echo",     "ns",                  AT(after_s),      0.0,   1e-5, 1e9,  ALL,        0},
    {"the near end of the window",  "m",                   AT(near_m),       0.0,   1e7,  1.0,  ALL,        0},
    {"the far end of the window",   "m",                   AT(far_m),        0.0,   1e7,  1.0,  ALL,        0},
};
/* clang-format on */

static int check_ranges(const struct waveform_spec *spec, struct sh_err *err)
{
    for (size_t i = 0; i < sizeof limits / sizeof *limits; i++) {
        const struct limit *l = &limits[i];
        const double value = *(const double *)(const void *)((const char *)spec + l->at);
        if (!(l->shapes & 1 << spec->shape) || (value >= l->low && value <= l->high)) continue;
        if (l->or_zero && value == 0.0) continue;
        return sh_fail(err, SH_EINPUT, "%s of %.6g %s: %.6g to %.6g is allowed%s", l->what, value * l->scale, l->unit,
                       l->low * l->scale, l->high * l->scale, l->or_zero ? ", or 0 for none" : "");
    }
    return SH_OK;
}

static int check_table(const struct waveform_spec *spec, struct sh_err *err)
{
    double most = 0.0;
    if (spec->table == NULL || spec->n_table < 2 || spec->n_table > WAVEFORM_MAX_TABLE)
        return sh_fail(err, SH_EINPUT, "a pulse's table of %u values: 2 to %d are allowed",
                       spec->table == NULL ? 0 : spec->n_table, WAVEFORM_MAX_TABLE);
    for (uint32_t i = 0; i < spec->n_table; i++) {
        if (!(spec->table[i] >= 0.0) || !(spec->table[i] <= 1e30))
            return sh_fail(err, SH_EINPUT, "value %u of a pulse's table is %.6g: 0 to 1e30 is allowed", i + 1,
                           spec->table[i]);
        most = fmax(most, spec->table[i]);
    }
    return most > 0.0 ? SH_OK : sh_fail(err, SH_EINPUT, "a pulse's table of zeros: some value must be above 0");
}

static int check_gate(const struct waveform_spec *spec, struct sh_err *err)
{
    const double sample_m = 0.5 * LIGHT_SPEED_M_S * spec->sample_s, long_m = spec->far_m - spec->near_m;
    if (long_m >= sample_m && long_m <= (WAVEFORM_MAX_SAMPLES - 1) * sample_m) return SH_OK;
    return sh_fail(err, SH_EINPUT,
                   "a window from %.6g to %.6g m: %.4g to %.6g m of length are allowed, 1 to %d samples", spec->near_m,
                   spec->far_m, digits_up(sample_m, 4), digits_down((WAVEFORM_MAX_SAMPLES - 1) * sample_m, 6),
                   WAVEFORM_MAX_SAMPLES - 1);
}

static int check_windows(const struct waveform_spec *spec, struct sh_err *err)
{
    const double most = 0.5 * WAVEFORM_MAX_SAMPLES, samples = (spec->before_s + spec->after_s) / spec->sample_s;
    if (spec->near_m < spec->far_m) return check_gate(spec, err);
    if (!(spec->keep >= 1e-6 && spec->keep <= 1e9))
        return sh_fail(err, SH_EINPUT, "windows around a signal of %.6g times the threshold: 1e-06 to 1e+09 is allowed",
                       spec->keep);
    /* Times that add up to `most` in ns may exceed it in s by a rounding error. */
    if (samples <= most * (1.0 + 1e-9)) return SH_OK;
    return sh_fail(err, SH_EINPUT,
                   "%.6g ns kept before an echo and %.6g ns after it: together at most %.6g ns, %.0f samples",
                   1e9 * spec->before_s, 1e9 * spec->after_s, digits_down(1e9 * most * spec->sample_s, 6), most);
}

int waveform_check(const struct waveform_spec *spec, struct sh_err *err)
{
    int rc = check_ranges(spec, err);
    if (rc == SH_OK && spec->shape == WAVEFORM_TABLE) rc = check_table(spec, err);
    if (rc != SH_OK) return rc;
    if (spec->bits < 8 || spec->bits > 14)
        return sh_fail(err, SH_EINPUT, "a digitiser of %u bits: 8 to 14 are allowed", spec->bits);
    const double top = (double)(1U << spec->bits) - 1.0;
    if (!(spec->baseline_counts >= 0.0 && spec->baseline_counts <= 0.5 * top))
        return sh_fail(err, SH_EINPUT, "a baseline of %.6g counts: 0 to %.6g is allowed with %u bits",
                       spec->baseline_counts, 0.5 * top, spec->bits);
    if (spec->dead_s > 0.0 && spec->saturation == 0.0)
        return sh_fail(err, SH_EINPUT, "a dead time of %.6g ns begins with saturation, and no signal saturates here",
                       1e9 * spec->dead_s);
    return check_windows(spec, err);
}
