/* SPDX-License-Identifier: MIT */
/* Full waveform: the light that comes back of one pulse, over time, as a digitiser samples it.
 *
 * Signal. Power is counted as in detect.h, in units of the detection threshold: a return of amplitude A from a surface
 * that is hit head on peaks at A. The signal is the sum over all returns r of the pulse,
 *
 *     P(t) = sum_r A_r (h * q_r)(t - 2 R_r / c),
 *
 * h the outgoing pulse after the receiver's bandwidth, with its centroid at t = 0, and q_r how the return's energy
 * spreads over time, with integral 1 and its centroid at 0. h is scaled so that the outgoing pulse without the receiver
 * peaks at 1. So the integral of P over time is sum_r A_r times the integral of h: the link budget, whatever the
 * surfaces do to the shape.
 *
 * Samples. Sample k of a pulse is taken at k sample_s after its emission: one grid for all windows of a pulse. A count
 * is baseline + (P + n) / full_scale times the counts above the baseline, rounded and limited to 0 .. 2^bits - 1. n is
 * white Gaussian noise of the spec's sigma. Random numbers are keyed by (seed, scan, pulse, sample): nothing depends on
 * which windows are kept.
 *
 * Ownership: waveform_create makes a waveform, waveform_free releases it; constant in between, any thread. Sampling
 * allocates nothing. */
#ifndef CORE_WAVEFORM_H
#define CORE_WAVEFORM_H

#include <stdint.h>

#include "core/err.h"

enum waveform_shape { WAVEFORM_GAUSSIAN, WAVEFORM_ASYMMETRIC, WAVEFORM_TABLE };

enum { WAVEFORM_MAX_WINDOWS = 16, WAVEFORM_MAX_SAMPLES = 4096, WAVEFORM_MAX_TABLE = 1024 };

struct waveform_spec {
    enum waveform_shape shape;
    double width_s;      /* of the outgoing pulse, full at half maximum; not for a table */
    double skew;         /* asymmetric: fall time over rise time, >= 1 */
    const double *table; /* [n_table], >= 0: a measured pulse, any scale; copied */
    uint32_t n_table;
    double table_step_s;
    double bandwidth_hz;    /* of the receiver, -3 dB; 0: no limit */
    double sample_s;        /* of the digitiser */
    uint32_t bits;          /* 8 .. 14 */
    double baseline_counts; /* the count without light */
    double full_scale;      /* signal, in thresholds, at the largest count */
    double saturation;      /* the receiver gives no more than this signal, in thresholds; 0: no limit */
    double dead_s;          /* after a saturated sample the receiver gives nothing for so long; 0: none */
    double noise;           /* sigma, in thresholds: 1/k of detect.h */
    /* Windows. A window is kept around all samples whose signal reaches `keep` thresholds, from before_s before the
     * first to after_s after the last; windows that touch are one. Where near_m < far_m, one window from near_m to
     * far_m is kept in place of these, whatever comes back. */
    double keep, before_s, after_s;
    double near_m, far_m;
    uint64_t seed;
};

struct waveform;

/* Makes a waveform. SH_EINPUT: a value is out of its range. The text says what is allowed, without the file's name. */
int waveform_create(const struct waveform_spec *spec, struct waveform **out, struct sh_err *err);
void waveform_free(struct waveform *waveform);

/* This says how the energy of a return spreads over range. */
enum waveform_spread {
    WAVEFORM_POINT, /* not at all: a sub-ray */
    WAVEFORM_DISC, /* a whole footprint on one plane: the irradiance's marginal over -extent .. extent (footprint.h: the
                     * disc within the 1/e2 radius); extent = w(R) tan i */
    WAVEFORM_BELL, /* a part of a footprint on one plane: Gaussian, extent is its standard deviation */
};

struct waveform_return {
    double range_m;   /* of its centroid */
    double amplitude; /* A, >= 0 */
    double extent_m;
    enum waveform_spread spread;
};

/* The window of samples first .. first + n of the pulse's grid. Sample k lies at range k sample_s c / 2. */
struct waveform_window {
    uint32_t first, n;
    uint32_t at; /* of its first sample in the array of all windows */
};

struct waveform_record {
    uint32_t n_windows, n_samples;
    struct waveform_window window[WAVEFORM_MAX_WINDOWS];
    uint16_t *sample; /* [capacity]: the caller's */
    uint32_t capacity;
    uint32_t n_left_out; /* samples of windows for which there was no room here: they count as lost */
};

/* Makes the samples of one pulse. scan_key: rng_scan; pulse: its number in the scan. */
void waveform_sample(const struct waveform *waveform, uint64_t scan_key, uint64_t pulse,
                     const struct waveform_return *returns, uint32_t n, struct waveform_record *record);
/* Returns P at range r_m, without noise, the receiver's limits and rounding, for tests and closed forms. */
double waveform_signal(const struct waveform *waveform, const struct waveform_return *returns, uint32_t n, double r_m);
/* Returns the integral of h over time, s. */
double waveform_pulse_area_s(const struct waveform *waveform);
/* Returns the spec. */
const struct waveform_spec *waveform_spec_of(const struct waveform *waveform);

/* ---- detection: echoes from the samples of one pulse, as the head's firmware finds them */

enum waveform_detector {
    WAVEFORM_THRESHOLD, /* where the signal rises through a fixed level; h gives the time from there to the centroid */
    WAVEFORM_FRACTION,  /* constant fraction of the peak */
    WAVEFORM_GAUSSIANS, /* Gaussian decomposition (W. Wagner et al. 2006), Levenberg-Marquardt */
};

struct waveform_echo {
    double range_m;
    double amplitude; /* peak of its signal over that of h, in thresholds: A of a surface that is hit head on */
    double width_s;   /* full at half maximum */
    double deviation; /* RMS of the samples about the echo's model, in counts per count of its amplitude; RIEGL's "pulse
                        * shape deviation" has this meaning */
    int saturated;    /* a sample of it was at the largest count, or limited */
};

/* SH_EINPUT: echoes are not found with this pulse, since a long and weak part of the pulse keeps its centroid away from
 * its peak. The text is without the file's name. Samples of such a pulse are as good as others. */
int waveform_check_detection(const struct waveform *waveform, struct sh_err *err);
/* Returns the largest value of h, of a pulse with which echoes are found. */
double waveform_pulse_peak(const struct waveform *waveform);

/* Finds at most `most` echoes of an amplitude of 1 or more, in the order of range. Returns how many, and adds to
 * *n_crowded those that found no room: the weakest are left out. The function finds none where waveform_check_detection
 * fails. Pure. */
uint32_t waveform_detect(const struct waveform *waveform, enum waveform_detector detector,
                         const struct waveform_record *record, struct waveform_echo *echoes, uint32_t most,
                         uint32_t *n_crowded);

#endif
