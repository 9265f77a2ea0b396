/* SPDX-License-Identifier: MIT */
/* This makes waveforms of known returns, and compares what the detectors find in them. */
#ifndef TESTS_COMMON_WAVE_ECHOES_H
#define TESTS_COMMON_WAVE_ECHOES_H

#include "tests/common/wave_spec.h"

enum { WAVE_MOST = 16, WAVE_DETECTORS = 3 };
extern const char *const wave_detector_name[WAVE_DETECTORS];

struct wave_echoes {
    struct waveform *waveform;
    uint16_t sample[WAVEFORM_MAX_SAMPLES];
    struct waveform_record record;
    struct waveform_echo echo[WAVE_MOST];
    uint32_t most, n, n_crowded;
};

/* Room for 16 echoes a pulse. Fails the test where the spec is refused. */
void wave_open(struct wave_echoes *w, const struct waveform_spec *spec);
void wave_close(struct wave_echoes *w);
/* Samples a pulse and detects at level 1. Returns the number of echoes. */
uint32_t wave_shoot(struct wave_echoes *w, enum waveform_detector detector, uint64_t pulse,
                    const struct waveform_return *returns, uint32_t n);
/* The same for samples that the caller has put into w->record. */
uint32_t wave_detect(struct wave_echoes *w, enum waveform_detector detector);

/* The first echo of many pulses on one return, at as many phases of the sampling. */
struct wave_figures {
    uint32_t single;                                       /* pulses with one echo */
    double bias_m, sigma_m;                                /* of its range about the return's */
    double amplitude, width_s, deviation, sigma_amplitude; /* means, and the amplitude's deviation */
};
void wave_measure(struct wave_echoes *w, enum waveform_detector detector, uint32_t pulses,
                  const struct waveform_return *part, struct wave_figures *figures);

void wave_near(double got, double want, double most);
void wave_between(double got, double least, double most);

/* ---- what theory says of the pulse of wave_spec */

/* Returns sigma of a Gaussian by its full width at half maximum. */
double wave_sigma(double width);
/* Returns the least deviation (Cramer and Rao) of the range of a Gaussian echo in white noise. The echo's peak and
 * sigma have no part in the deviation: their derivatives are even, and the place's is odd. The sum of
 * (A (t - t0) / s^2 g)^2 over samples dt apart is A^2 sqrt(pi) / (2 s dt). */
double wave_least_sigma_m(double peak, double noise, double sigma_s, double sample_s);

#endif
