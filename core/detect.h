/* SPDX-License-Identifier: MIT */
/* Detection: from the light that comes back to the echoes that the head reports. Arrays have one entry per
 * echo, so a pulse may have several.
 *
 * Signal. The range equation for a target that the beam doesn't miss (W. Wagner et al., Gaussian
 * decomposition and calibration of a novel small-footprint full-waveform digitising airborne laser scanner,
 * 2006): the received power is proportional to rho(i) / R^2 and to exp(-2 a R), a the extinction of the air. This
 * module counts the power in units of the detection threshold:
 *
 *     A = E rho(i) o(R) exp(-2 a R) / rho_min(R)
 *
 * with E the share of the pulse's energy on the way to the target and back, rho(i) as in surface.h, and rho_min(R)
 * the reflectance that is just seen at R. rho_min follows from the data sheet's ranges R_k for targets of rho_k: log
 * rho_min = 2 log R + g(R) passes through each of them, and g is linear between them. The slope of g is 2 a
 * for the air on the data sheet's day. Beyond the last and before the first R_k the nearest slope holds;
 * with a single R_k it is 0. So the a in A is only the extinction beyond that of the data sheet's day.
 * o(R) = 1 - exp(-(R / R_o)^2): at short range part of the light misses the detector (Y. Fang et al.,
 * Intensity correction of terrestrial laser scanning data by estimating laser transmission function, 2015,
 * with the lens's parameters taken together into R_o, near which the signal is strongest).
 *
 * Detection. The signal carries Gaussian noise of sigma 1/k in units of the threshold, k the signal-to-noise
 * ratio at the threshold and n a standard normal number. The signal is detected where A + n/k >= 1, with probability
 * Phi(k (A - 1)). So half of the pulses see a target at the data sheet's range. The reflectance is (A + n/k) rho_min(R)
 * / o(R): relative to a white Lambertian target at that range, hit head on, in the data sheet's air. The amplitude in
 * dB above the threshold, as a head measures it, is 10 log10 (A + n/k). A detected echo has 0 dB or more.
 *
 * Range noise. The time of an echo has a jitter of rise time over signal-to-noise ratio (M. Skolnik,
 * Introduction to radar systems, 1980), and a part that no signal makes smaller (clock, digits):
 *
 *     sigma^2 = floor^2 + (X^2 - floor^2) (A_Y / A)^2,  and a part per distance added to sigma
 *
 * for a data sheet's `X at Y m`, A_Y the amplitude of a target of its reflectance at Y, head on. With k below 8 noise
 * alone may be detected, where A is nearly 0. A counts as DETECT_LEAST_AMPLITUDE or more here: ranges stay finite.
 *
 * Random numbers are keyed by (seed, scan, pulse, echo, purpose): nothing depends on what else was detected.
 * Entries without echo stay so. Pure; any thread; allocates nothing. */
#ifndef CORE_DETECT_H
#define CORE_DETECT_H

#include <stdint.h>

#include "core/err.h"
#include "core/surface.h"

enum { DETECT_MAX_REACHES = 8 };
/* With k of 8 or more a lower A isn't detected: the largest random number of all is 6.8 sigmas. */
#define DETECT_LEAST_AMPLITUDE 0.1

/* A data sheet's range for a reflectance. */
struct detect_reach {
    double reflectance, range_m;
};

struct detect_signal_spec {
    uint32_t n_reaches; /* at least 1 */
    struct detect_reach reach[DETECT_MAX_REACHES];
    double threshold_snr;  /* k, > 0 */
    int sharp;             /* no noise on the signal: detected where A >= 1 */
    double overlap_m;      /* R_o; 0: all light is caught at any range */
    double extinction_1_m; /* beyond that of the data sheet's day; may be below 0 */
    /* X at Y m on a target of that reflectance; sigma_floor_m is the part that no signal makes smaller */
    double sigma_m, sigma_at_m, sigma_reflectance, sigma_floor_m, sigma_ppm;
    uint64_t seed;
};

struct detect_signal {
    /* g = g0 + sum over n pieces of more_1_m (R - at_m): the first holds everywhere, the others where R > at_m */
    uint32_t n;
    double g0, at_m[DETECT_MAX_REACHES], more_1_m[DETECT_MAX_REACHES];
    double per_overlap2, extinction2_1_m;
    double steepest_1_m;    /* log A changes with range by at most 2 / R plus this */
    double per_snr;         /* 1/k; 0: sharp */
    double floor2, jitter2; /* parts of sigma^2: the constant one, and the other one at A = 1 */
    double per_distance;
    uint64_t signal_key, range_key;
};

/* Fails with SH_EINPUT where no air explains the reaches, or where sigma_floor_m is above sigma_m. Air does not explain
 * them where two have the same range, or where the signal falls less than with the square of the range. A shortfall of
 * less than 10 % counts as rounding of the data sheet. The text names no file. Reaches may come in any order. */
int detect_signal_set_up(const struct detect_signal_spec *spec, struct detect_signal *signal, struct sh_err *err);

/* Returns the amplitude A of the light that comes back from range_m. rho: the product E rho(i). */
double detect_amplitude(const struct detect_signal *signal, double range_m, double rho);

/* Returns the reflectance that a head reports for an amplitude at range_m, in the data sheet's air. */
double detect_reflectance(const struct detect_signal *signal, double range_m, double amplitude);

/* Returns the extinction for a visibility (Koschmieder: contrast of 2 % at 550 nm), by Kruse's formula with Kim's
 * exponents (I. Kim et al., Comparison of laser beam propagation at 785 nm and 1550 nm in fog and haze,
 * 2001). */
double detect_extinction_1_m(double visibility_m, double wavelength_m);

struct detect_echoes {
    uint32_t n;
    const uint64_t *key; /* rng_echo(pulse, number) */
    double *range_m;     /* along the beam; NaN: no echo */
    const double *rho;   /* surface_return, times the share E of the pulse's energy */
    double *amplitude;   /* A, without noise */
    int16_t *refl_cdb;   /* 0.01 dB; LINE_REFL_NONE where there is no echo */
    uint64_t scan_key;   /* rng_scan */
};

/* Fills amplitude and refl_cdb; range_m becomes NaN where nothing is detected. */
void detect_by_signal(const struct detect_signal *signal, const struct detect_echoes *echoes);
/* Called after that. Sets amplitudes in 0.01 dB above the threshold; LINE_AMPLITUDE_NONE where there is no echo. */
void detect_amplitudes(const struct detect_signal *signal, const struct detect_echoes *echoes, int16_t *amplitude_cdb);
/* Adds range noise by the amplitude. */
void detect_range_noise(const struct detect_signal *signal, const struct detect_echoes *echoes);
/* Adds range noise of sigma0 + sigma1 * range, whatever the signal. */
void detect_fixed_noise(double sigma0_m, double sigma1, uint64_t range_key, uint32_t n, const uint64_t *key,
                        double *range_m);

/* Range ambiguity: an echo from beyond R_u = c T / 2 (T: time between pulses) comes back after the next pulse has left.
 * Folded: its range is measured from the last pulse that had left by then: R mod R_u. (It stays with its own pulse
 * here, and so it has that pulse's direction.) Resolved: its range is right up to a number of zones; echoes beyond
 * them are lost. In both an echo is lost that comes back while the head is blind, less than range_min_m after a
 * pulse. */
enum detect_ambiguity { DETECT_AMBIGUITY_NONE, DETECT_FOLDED, DETECT_RESOLVED };
void detect_zones(enum detect_ambiguity how, double period_s, uint32_t zones, double range_min_m, uint32_t n,
                  double *range_m);

/* The ball-shaped noise of TLSynth: each point is moved to a place in a ball around it, with all places
 * equally likely. The ball's radius is radius_m (1 + per_distance_1_m R), then each axis is stretched by its
 * factor. */
struct detect_ball {
    double radius_m, factor[3], per_distance_1_m;
    int local; /* axes: along the beam, to the right (along the mirror's axis), up; else those of the scene */
    uint64_t direction_key, radius_key;
};
void detect_ball_keys(struct detect_ball *ball, uint64_t seed);
/* Points, given by range and angles (turns) in the head's frame; ranges of NaN are left alone. */
struct detect_points {
    uint32_t n;
    const uint64_t *key;
    double *range_m, *mirror_turn, *pan_turn;
    uint64_t scan_key; /* rng_scan */
};
/* Moves each point within its ball. rotation: socs -> prcs; NULL with local axes. */
void detect_move_in_ball(const struct detect_ball *ball, const double rotation[9], const struct detect_points *points);

#endif
