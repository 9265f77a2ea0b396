/* SPDX-License-Identifier: MIT */
/* This file has the outgoing pulse, the receiver's bandwidth, and both together as a fine table. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/digits.h"
#include "core/waveform/waveform_inside.h"

/* sigma of a Gaussian whose full width at half maximum is 1 */
#define SIGMA_1 0.42466090014400953
/* Beyond this many sigmas a Gaussian is below 1e-9 of its peak. */
#define GAUSSIAN_END 6.5
/* An asymmetric pulse ends where it has fallen to this: its tail is long. */
#define TAIL_LEAST 1e-6

enum { MIN_PHASES = 4, STEPS_PER_SCALE = 16, EDGE_STEPS = 4, FINEST = 64 };

/* The outgoing pulse, which lasts from from_s to to_s, in seconds after its peak (a table: after its first value). The
 * pulse consists of pieces of equal length. Sums over it take the same number of steps in each piece, and a step is at
 * most fine_s long. */
struct outgoing {
    const struct waveform_spec *spec;
    double from_s, to_s, fine_s, pieces;
};

/* Returns the log-normal pulse with its peak of 1 at 0: exp(-ln 2 (ln(1 + a t) / ln s)^2), a = (s - 1/s) / width.
 * Half of the peak is reached at ln(1 + a t) = -ln s and ln s, so the time from the peak to the half on the falling
 * side is s times that on the rising side, and both together are the width. With s -> 1 the pulse is the Gaussian. */
static double log_normal(double t_s, double width_s, double skew)
{
    const double s = fmax(skew, 1.0 + 1e-6), x = (s - 1.0 / s) / width_s * t_s;
    if (x <= -1.0) return 0.0;
    const double y = log1p(x) / log(s);
    return exp(-M_LN2 * y * y);
}

static double table_at(const struct waveform_spec *spec, double t_s)
{
    double at = t_s / spec->table_step_s;
    if (!(at >= 0.0) || at > spec->n_table - 1) return 0.0;
    uint32_t i = (uint32_t)at < spec->n_table - 1 ? (uint32_t)at : spec->n_table - 2;
    return spec->table[i] + (spec->table[i + 1] - spec->table[i]) * (at - i);
}

static double outgoing_at(const struct outgoing *o, double t_s)
{
    const struct waveform_spec *spec = o->spec;
    if (t_s < o->from_s || t_s > o->to_s) return 0.0;
    if (spec->shape == WAVEFORM_TABLE) return table_at(spec, t_s);
    if (spec->shape == WAVEFORM_ASYMMETRIC) return log_normal(t_s, spec->width_s, spec->skew);
    double x = t_s / (SIGMA_1 * spec->width_s);
    return exp(-0.5 * x * x);
}

static struct outgoing outgoing_of(const struct waveform_spec *spec)
{
    const double s = fmax(spec->skew, 1.0 + 1e-6), tail = pow(s, sqrt(-log(TAIL_LEAST) / M_LN2));
    const double per_a_s = spec->width_s / (s - 1.0 / s), sigma_s = SIGMA_1 * spec->width_s;
    const double step_s = spec->table_step_s, lines = spec->n_table - 1.0;
    if (spec->shape == WAVEFORM_TABLE) return (struct outgoing){spec, 0.0, lines * step_s, 0.25 * step_s, lines};
    if (spec->shape == WAVEFORM_ASYMMETRIC)
        return (struct outgoing){spec, (1.0 / tail - 1.0) * per_a_s, (tail - 1.0) * per_a_s, 0.25 * sigma_s / s, 1.0};
    return (struct outgoing){spec, -GAUSSIAN_END * sigma_s, GAUSSIAN_END * sigma_s, 0.25 * sigma_s, 1.0};
}

/* Returns in how many steps of at most fine_s the pulse is taken. */
static double parts_of(const struct outgoing *o, double fine_s)
{
    return o->pieces * ceil((o->to_s - o->from_s) / o->pieces / fine_s);
}

/* Returns sigma of the receiver's impulse response. The receiver is a Gaussian low-pass, exp(-ln 2 / 2 (f / B)^2), to
 * which chains of many stages tend. The response is centred on the time that Elmore calls the delay, so the receiver
 * delays nothing here (W. C. Elmore, The transient response of damped linear networks, J. Appl. Phys. 19, 1948). */
static double receiver_sigma_s(double bandwidth_hz)
{
    return bandwidth_hz > 0.0 ? sqrt(M_LN2) / (2.0 * M_PI * bandwidth_hz) : 0.0;
}

/* Returns the spectrum of h at an angular frequency, divided by its value at 0. */
static double spectrum(const struct outgoing *o, double sigma_s, double per_s)
{
    const double parts = parts_of(o, fmin(o->fine_s, 0.1 * o->spec->sample_s)), part_s = (o->to_s - o->from_s) / parts;
    double all = 0.0, even = 0.0, odd = 0.0;
    for (double j = 0.0; j <= parts; j += 1.0) {
        const double t_s = o->from_s + j * part_s, p = outgoing_at(o, t_s);
        all += p;
        even += p * cos(per_s * t_s);
        odd += p * sin(per_s * t_s);
    }
    return sqrt(even * even + odd * odd) / all * exp(-0.5 * per_s * per_s * sigma_s * sigma_s);
}

/* Returns sigma of the Gaussian whose spectrum falls to 1e-5 at the same frequency as that of h. The spectrum of a
 * table's straight lines may not fall so far. Then least_s holds, since the sampling doesn't resolve more. */
static double scale_of(const struct outgoing *o, double sigma_s)
{
    const double end = 4.798526, least_s = 0.3 * o->spec->sample_s; /* exp(-end^2 / 2) = 1e-5 */
    double scale_s = least_s;
    while (spectrum(o, sigma_s, end / (1.05 * scale_s)) < 1e-5)
        scale_s *= 1.05;
    return scale_s;
}

/* Fills h, which is the pulse convolved with the receiver's impulse response, on n steps. The first step is at from_s,
 * and the whole of h lies within the n steps. The sum over the pulse is fine enough for the pulse and for the response.
 * A response shorter than 1/64 of a step would change h by less than 1e-6, and is left out. */
static void fill_steps(const struct outgoing *o, double from_s, double step_s, double sigma_s, uint32_t n, double *h)
{
    const double fine_s = fmin(o->fine_s, sigma_s), reach_s = GAUSSIAN_END * sigma_s;
    for (uint32_t i = 0; i < n; i++)
        h[i] = sigma_s < step_s / FINEST ? outgoing_at(o, from_s + i * step_s) : 0.0;
    if (sigma_s < step_s / FINEST) return;
    const double parts = parts_of(o, fine_s), part_s = (o->to_s - o->from_s) / parts;
    for (double j = 0.0; j <= parts; j += 1.0) {
        const double t_s = o->from_s + j * part_s, share = part_s / (sigma_s * sqrt(2.0 * M_PI)) * outgoing_at(o, t_s);
        const uint32_t first = (uint32_t)ceil((t_s - reach_s - from_s) / step_s);
        for (uint32_t i = first; i < n && from_s + i * step_s <= t_s + reach_s; i++) {
            const double x = (from_s + i * step_s - t_s) / sigma_s;
            h[i] += share * exp(-0.5 * x * x);
        }
    }
}

/* Returns the largest relative deviation of a sum of samples, `apart` steps from each other, from the sum of all
 * steps. */
static double ripple(const double *h, uint32_t n, uint32_t apart)
{
    double all = 0.0, worst = 0.0;
    for (uint32_t i = 0; i < n; i++)
        all += h[i];
    if (all == 0.0) return 1.0; /* All of it falls between the steps. */
    for (uint32_t phase = 0; phase < apart; phase++) {
        double sum = 0.0;
        for (uint32_t i = phase; i < n; i += apart)
            sum += h[i];
        worst = fmax(worst, fabs(sum * apart / all - 1.0));
    }
    return worst;
}

static int check_ripple(const struct waveform_spec *spec, const double *h, uint32_t n, uint32_t phases,
                        struct sh_err *err)
{
    const double most = 1e-3, off = ripple(h, n, phases);
    uint32_t apart = phases;
    if (off <= most) return SH_OK;
    while (apart > 1 && ripple(h, n, apart) > most)
        apart--;
    return sh_fail(
        err, SH_EINPUT,
        "samples %.4g ns apart are too coarse for this pulse: the energy in them changes by %.2g %% with the "
        "range; 0.1 %% is allowed, so at most %.3g ns, or a longer pulse, or a receiver of less bandwidth",
        1e9 * spec->sample_s, 1e2 * off, digits_down(1e9 * spec->sample_s * apart / phases, 3));
}

static int fold(const struct waveform_spec *spec, const double *h, uint32_t n, struct waveform_pulse *pulse,
                struct sh_err *err)
{
    double sum = 0.0, moment = 0.0;
    pulse->h = calloc((size_t)pulse->phases * pulse->pitch, sizeof *pulse->h);
    if (pulse->h == NULL) return sh_fail(err, SH_ENOMEM, "waveform: no memory");
    for (uint32_t i = 0; i < n; i++) {
        pulse->h[(size_t)(i % pulse->phases) * pulse->pitch + i / pulse->phases] = h[i];
        sum += h[i];
        moment += h[i] * i;
    }
    pulse->area_s = sum * spec->sample_s / pulse->phases;
    pulse->lead = moment / sum / pulse->phases;
    pulse->lag = (double)n / pulse->phases - pulse->lead;
    return SH_OK;
}

int waveform_pulse_make(const struct waveform_spec *spec, struct waveform_pulse *pulse, struct sh_err *err)
{
    const struct outgoing o = outgoing_of(spec);
    const double sigma_s = receiver_sigma_s(spec->bandwidth_hz), end_s = GAUSSIAN_END * sigma_s;
    /* There are 2 samples more: one has room for the EDGE_STEPS before the pulse, and one comes after it. */
    const double length = ceil((o.to_s - o.from_s + 2.0 * end_s) / spec->sample_s) + 2.0;
    if (length > WAVEFORM_MAX_SAMPLES)
        return sh_fail(err, SH_EINPUT, "the pulse is %.0f samples of %.4g ns long; at most %d are allowed", length,
                       1e9 * spec->sample_s, WAVEFORM_MAX_SAMPLES);
    const double scale_s = scale_of(&o, sigma_s);
    const double phases = fmax(MIN_PHASES, ceil(STEPS_PER_SCALE * spec->sample_s / scale_s));
    const double step_s = spec->sample_s / phases, from_s = o.from_s - end_s - EDGE_STEPS * step_s;
    pulse->phases = (uint32_t)phases;
    pulse->length = (uint32_t)length;
    pulse->pitch = pulse->length + 1;
    pulse->scale = scale_s / spec->sample_s;
    const uint32_t n = pulse->phases * pulse->length;
    double *h = malloc(n * sizeof *h);
    if (h == NULL) return sh_fail(err, SH_ENOMEM, "waveform: no memory");
    fill_steps(&o, from_s, step_s, sigma_s, n, h);
    int rc = check_ripple(spec, h, n, pulse->phases, err);
    if (rc == SH_OK) rc = fold(spec, h, n, pulse, err);
    free(h);
    return rc;
}

void waveform_pulse_free(struct waveform_pulse *pulse)
{
    free(pulse->h);
}
