/* SPDX-License-Identifier: MIT */
#include "tests/unit/waveform_rig.h"

#include <math.h>

#include "tests/common/wave_spec.h"

struct waveform_spec waveform_rig_spec(void)
{
    struct waveform_spec spec = wave_spec();
    spec.baseline_counts = 100.0;
    spec.full_scale = 1000.0;
    spec.noise = 0.0;
    spec.keep = 1.0;
    spec.before_s = 5e-9;
    spec.after_s = 8e-9;
    return spec;
}

struct waveform *waveform_rig_open(const struct waveform_spec *spec)
{
    struct waveform *w;
    struct sh_err err;
    if (waveform_create(spec, &w, &err) != SH_OK) fail_msg("%s", err.text);
    return w;
}

/* The log-normal has half of its peak at ln(1 + a t) = -ln s and ln s. The log-normal's moments follow from those of
 * exp(n u) under a Gaussian of u = ln(1 + a t) with sigma k = ln s / sqrt(2 ln 2): the area is
 * k sqrt(2 pi) exp(k^2 / 2) / a, and the mean of 1 + a t is exp(3 k^2 / 2). */
double waveform_rig_pulse(const struct waveform_spec *spec, double t_s)
{
    if (spec->skew == 1.0) return pow(0.5, 4.0 * t_s * t_s / (spec->width_s * spec->width_s));
    const double a = (spec->skew - 1.0 / spec->skew) / spec->width_s, k2 = pow(log(spec->skew), 2) / (2.0 * M_LN2);
    const double x = exp(1.5 * k2) + a * t_s;
    return x > 0.0 ? pow(0.5, pow(log(x) / log(spec->skew), 2)) : 0.0;
}

double waveform_rig_area_s(const struct waveform_spec *spec)
{
    if (spec->skew == 1.0) return 0.5 * spec->width_s * sqrt(M_PI / M_LN2);
    const double a = (spec->skew - 1.0 / spec->skew) / spec->width_s, k2 = pow(log(spec->skew), 2) / (2.0 * M_LN2);
    return sqrt(2.0 * M_PI * k2) * exp(0.5 * k2) / a;
}

double waveform_rig_receiver_s(const struct waveform_spec *spec)
{
    /* |G(f)|^2 = exp(-(2 pi f sigma)^2) = 1/2 */
    return spec->bandwidth_hz > 0.0 ? sqrt(M_LN2) / (2.0 * M_PI * spec->bandwidth_hz) : 0.0;
}
