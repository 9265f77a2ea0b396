/* SPDX-License-Identifier: MIT */
#include "tests/common/wave_echoes.h"

#include <math.h>
#include <string.h>

#include "tests/common/cases.h"

#include "core/light.h"

const char *const wave_detector_name[WAVE_DETECTORS] = {"threshold", "fraction", "gaussians"};

void wave_open(struct wave_echoes *w, const struct waveform_spec *spec)
{
    struct sh_err err;
    memset(w, 0, sizeof *w);
    w->record.sample = w->sample;
    w->record.capacity = WAVEFORM_MAX_SAMPLES;
    w->most = WAVE_MOST;
    if (waveform_create(spec, &w->waveform, &err) != SH_OK) fail_msg("%s", err.text);
}

void wave_close(struct wave_echoes *w)
{
    waveform_free(w->waveform);
}

uint32_t wave_detect(struct wave_echoes *w, enum waveform_detector detector)
{
    w->n_crowded = 0;
    w->n = waveform_detect(w->waveform, detector, &w->record, w->echo, w->most, &w->n_crowded);
    return w->n;
}

uint32_t wave_shoot(struct wave_echoes *w, enum waveform_detector detector, uint64_t pulse,
                    const struct waveform_return *returns, uint32_t n)
{
    waveform_sample(w->waveform, 0, pulse, returns, n, &w->record);
    return wave_detect(w, detector);
}

void wave_measure(struct wave_echoes *w, enum waveform_detector detector, uint32_t pulses,
                  const struct waveform_return *part, struct wave_figures *figures)
{
    const double sample_m = 0.5 * LIGHT_SPEED_M_S * waveform_spec_of(w->waveform)->sample_s;
    double sum[6] = {0.0};
    struct wave_figures f = {0};
    for (uint32_t p = 0; p < pulses; p++) {
        struct waveform_return r = *part;
        r.range_m += (p + 0.5) / pulses * sample_m;
        if (wave_shoot(w, detector, p, &r, 1) != 1) continue;
        const struct waveform_echo *e = &w->echo[0];
        double off = e->range_m - r.range_m,
               figure[6] = {off, off * off, e->amplitude, e->width_s, e->deviation, e->amplitude * e->amplitude};
        for (int k = 0; k < 6; k++)
            sum[k] += figure[k];
        f.single++;
    }
    const double n = f.single > 0 ? f.single : 1.0;
    f.bias_m = sum[0] / n;
    f.sigma_m = sqrt(fmax(0.0, sum[1] / n - f.bias_m * f.bias_m));
    f.amplitude = sum[2] / n;
    f.width_s = sum[3] / n;
    f.deviation = sum[4] / n;
    f.sigma_amplitude = sqrt(fmax(0.0, sum[5] / n - f.amplitude * f.amplitude));
    *figures = f;
}

void wave_near(double got, double want, double most)
{
    if (!(fabs(got - want) <= most)) fail_msg("%.9g differs from %.9g by more than %.3g", got, want, most);
}

void wave_between(double got, double least, double most)
{
    if (!(got >= least && got <= most)) fail_msg("%.6g is not within %.6g .. %.6g", got, least, most);
}

double wave_sigma(double width)
{
    return width / (2.0 * sqrt(2.0 * M_LN2));
}

double wave_least_sigma_m(double peak, double noise, double sigma_s, double sample_s)
{
    return 0.5 * LIGHT_SPEED_M_S * noise / peak * sqrt(2.0 * sigma_s * sample_s / sqrt(M_PI));
}
