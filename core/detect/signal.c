/* SPDX-License-Identifier: MIT */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/detect.h"
#include "core/line.h"
#include "core/rng.h"
#include "core/vecmath.h"

static int by_range(const void *a, const void *b)
{
    const struct detect_reach *x = a, *y = b;
    return (x->range_m > y->range_m) - (x->range_m < y->range_m);
}

/* Fits g through the reaches. more_1_m is the difference between a slope and the previous one. */
static int fit_reaches(const struct detect_signal_spec *spec, struct detect_signal *signal, struct sh_err *err)
{
    struct detect_reach reach[DETECT_MAX_REACHES];
    double before = 0.0;
    memcpy(reach, spec->reach, sizeof reach);
    qsort(reach, spec->n_reaches, sizeof *reach, by_range);
    signal->n = spec->n_reaches > 1 ? spec->n_reaches - 1 : 1;
    signal->g0 = log(reach[0].reflectance) - 2.0 * log(reach[0].range_m);
    signal->at_m[0] = reach[0].range_m;
    for (uint32_t i = 0; i + 1 < spec->n_reaches; i++) {
        const struct detect_reach *a = &reach[i], *b = &reach[i + 1];
        double slope =
            (log(b->reflectance / a->reflectance) - 2.0 * log(b->range_m / a->range_m)) / (b->range_m - a->range_m);
        /* A data sheet rounds its figures to a few percent, so a deviation from R^2 of less than 10 % is taken for
         * rounding. */
        if (!(b->range_m > a->range_m) || slope * (b->range_m - a->range_m) < -0.1)
            return sh_fail(
                err, SH_EINPUT,
                "%.4g m on %.4g and %.4g m on %.4g: a signal must fall at least with the square of the range",
                a->range_m, a->reflectance, b->range_m, b->reflectance);
        signal->at_m[i] = a->range_m;
        signal->more_1_m[i] = slope - before;
        before = slope;
    }
    return SH_OK;
}

int detect_signal_set_up(const struct detect_signal_spec *spec, struct detect_signal *signal, struct sh_err *err)
{
    memset(signal, 0, sizeof *signal);
    int rc = fit_reaches(spec, signal, err);
    if (rc != SH_OK) return rc;
    if (spec->sigma_floor_m > spec->sigma_m)
        return sh_fail(err, SH_EINPUT, "a floor of the range noise of %.4g m is above the noise itself, %.4g m",
                       spec->sigma_floor_m, spec->sigma_m);
    signal->per_overlap2 = spec->overlap_m > 0.0 ? 1.0 / (spec->overlap_m * spec->overlap_m) : 0.0;
    signal->per_snr = spec->sharp ? 0.0 : 1.0 / spec->threshold_snr;
    double at_y = detect_amplitude(signal, spec->sigma_at_m, spec->sigma_reflectance);
    signal->floor2 = spec->sigma_floor_m * spec->sigma_floor_m;
    signal->jitter2 = (spec->sigma_m * spec->sigma_m - signal->floor2) * at_y * at_y;
    signal->per_distance = 1e-6 * spec->sigma_ppm;
    signal->extinction2_1_m = 2.0 * spec->extinction_1_m;
    signal->steepest_1_m = fabs(signal->extinction2_1_m); /* the overlap rises by at most the square that R^2 takes */
    for (uint32_t k = 0; k < signal->n; k++)
        signal->steepest_1_m += fabs(signal->more_1_m[k]);
    signal->signal_key = rng_key(spec->seed, RNG_SIGNAL);
    signal->range_key = rng_key(spec->seed, RNG_RANGE);
    return SH_OK;
}

/* Returns log rho_min. */
VEC_INLINE double log_least(const struct detect_signal *s, double range_m)
{
    double g = s->g0 + s->more_1_m[0] * (range_m - s->at_m[0]);
    for (uint32_t k = 1; k < s->n; k++)
        g += s->more_1_m[k] * (range_m > s->at_m[k] ? range_m - s->at_m[k] : 0.0);
    return 2.0 * vec_log(range_m) + g;
}

VEC_INLINE double overlap(double per_overlap2, double range_m)
{
    double x = range_m * range_m * per_overlap2, caught = 1.0 - vec_exp(-x);
    caught = x < 1e-5 ? x : caught; /* x^2/2 is left out: at most 5e-6 of x */
    return per_overlap2 == 0.0 ? 1.0 : caught;
}

double detect_amplitude(const struct detect_signal *signal, double range_m, double rho)
{
    return rho * overlap(signal->per_overlap2, range_m) *
           vec_exp(-log_least(signal, range_m) - signal->extinction2_1_m * range_m);
}

double detect_reflectance(const struct detect_signal *signal, double range_m, double amplitude)
{
    return amplitude * vec_exp(log_least(signal, range_m)) / overlap(signal->per_overlap2, range_m);
}

double detect_extinction_1_m(double visibility_m, double wavelength_m)
{
    double v = 1e-3 * visibility_m;
    double q = v > 50.0 ? 1.6 : v > 6.0 ? 1.3 : v > 1.0 ? 0.16 * v + 0.34 : v > 0.5 ? v - 0.5 : 0.0;
    return 3.912 / visibility_m * pow(wavelength_m / 550e-9, -q);
}

/* Computes g(R) (detect.h): each of its pieces adds the change of the slope. */
VEC_CLONES
static void sum_pieces(const struct detect_signal *s, uint32_t n, const double *restrict range_m, double *restrict g)
{
    const double g0 = s->g0, at0 = s->at_m[0], more0 = s->more_1_m[0];
    for (uint32_t i = 0; i < n; i++)
        g[i] = g0 + more0 * (range_m[i] - at0);
    for (uint32_t k = 1; k < s->n; k++) {
        const double at = s->at_m[k], more = s->more_1_m[k];
        for (uint32_t i = 0; i < n; i++)
            g[i] += more * (range_m[i] > at ? range_m[i] - at : 0.0);
    }
}

/* amplitude: holds g, becomes A. A range of NaN gives no A, and so no echo. */
VEC_CLONES
static void detect(const struct detect_signal *s, const struct detect_echoes *e)
{
    const double per_overlap2 = s->per_overlap2, extinction2 = s->extinction2_1_m, per_snr = s->per_snr;
    const uint64_t signal_key = s->signal_key ^ e->scan_key, *key = e->key;
    const double *rho = e->rho;
    double *range_m = e->range_m, *amplitude = e->amplitude;
    int16_t *refl_cdb = e->refl_cdb;
    const uint32_t n = e->n;
    VEC_LOOP
    for (uint32_t i = 0; i < n; i++) {
        double r = range_m[i] > 1e-6 ? range_m[i] : 1e-6;
        double least = 2.0 * vec_log(r) + amplitude[i], o = overlap(per_overlap2, r);
        double a = rho[i] * o * vec_exp(-least - extinction2 * r);
        double seen = a + per_snr * rng_normal(signal_key, key[i]);
        int detected = (seen >= 1.0) & (range_m[i] == range_m[i]);
        double cdb = 1000.0 / 2.302585092994045684 * (vec_log((detected ? seen : 1.0) / o) + least);
        uint64_t bits;
        cdb = cdb > 32767.0 ? 32767.0 : cdb; /* 327 dB: beyond any surface and range that can be set */
        cdb = cdb < -32767.0 ? -32767.0 : cdb;
        vec_round(cdb, &bits);
        amplitude[i] = a;
        refl_cdb[i] = (int16_t)(detected ? bits : (uint64_t)(uint16_t)LINE_REFL_NONE);
        range_m[i] = detected ? range_m[i] : (double)NAN;
    }
}

void detect_by_signal(const struct detect_signal *signal, const struct detect_echoes *e)
{
    sum_pieces(signal, e->n, e->range_m, e->amplitude);
    detect(signal, e);
}

VEC_CLONES
void detect_amplitudes(const struct detect_signal *signal, const struct detect_echoes *e, int16_t *restrict out)
{
    const double per_snr = signal->per_snr, *amplitude = e->amplitude, *range_m = e->range_m;
    const uint64_t signal_key = signal->signal_key ^ e->scan_key, *key = e->key;
    const uint32_t n = e->n;
    VEC_LOOP
    for (uint32_t i = 0; i < n; i++) {
        double seen = amplitude[i] + per_snr * rng_normal(signal_key, key[i]); /* the noise of detect() */
        int detected = range_m[i] == range_m[i];
        double cdb = 1000.0 / 2.302585092994045684 * vec_log(detected && seen > 1.0 ? seen : 1.0);
        uint64_t bits;
        cdb = cdb > 32767.0 ? 32767.0 : cdb; /* as in detect() */
        vec_round(cdb, &bits);
        out[i] = (int16_t)(detected ? bits : (uint64_t)(uint16_t)LINE_AMPLITUDE_NONE);
    }
}
