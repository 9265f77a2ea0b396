/* SPDX-License-Identifier: MIT */
/* The detectors share this: a window as signals, the shapes that echoes of the pulse have, and the echoes found.
 * h is the outgoing pulse after the receiver's bandwidth (waveform.h).
 *
 * Places and widths count in samples, from the first sample of the window; signals in thresholds. An echo's place is
 * its centroid, since that is its range (waveform.h).
 *
 * All of it is pure, as waveform_detect is. Nothing here allocates. */
#ifndef CORE_WAVEFORM_DETECT_INSIDE_H
#define CORE_WAVEFORM_DETECT_INSIDE_H

#include <stddef.h>
#include <stdint.h>

#include "core/waveform.h"

enum { FINDER_SPREADS = 12, FINDER_LEADS = 64, FINDER_SHAPE = 769, FINDER_MIX = 8, FINDER_PEAKS = 64 };
#define FINDER_NEAR       2.5                /* sigmas on both sides of an echo's centre that a fit of one term uses */
#define FINDER_LEAST      0.75               /* least sigma of an echo, over the pulse's: only noise makes it less */
#define FINDER_ROUGH      0.001              /* added to misfit and tail, which were learned on other samples */
#define FINDER_FWHM       2.3548200450309493 /* of a Gaussian, in standard deviations */
#define FINDER_LEAD_STEP  0.08
#define FINDER_SHAPE_STEP (1.0 / 64.0) /* widths of the pulse */
#define FINDER_SHAPE_LEAD 4.0          /* widths of the pulse before its centroid */
#define FINDER_SHAPE_LAG  8.0          /* widths of the pulse after it */

/* A fit is a sum of terms. A term is a Gaussian; where h is no Gaussian, it is h, stretched in time. A term's middle is
 * between its half maxima, and its sigma is that of a Gaussian of the same width. */
struct finder_term {
    double at, sigma, peak;
};

/* This struct has the true figures of the echo of a plane, without noise, and how they differ from those of the term
 * that fits the echo best. detect_learn.c lists the tilts of the planes. A real head is adjusted on such targets. */
struct finder_spread {
    double sigma;     /* of that term */
    double lag;       /* from the echo's centroid to that term's middle */
    double gain;      /* the echo's peak over that term's */
    double width;     /* of the echo, full at half maximum */
    double half_lead; /* from the echo's rising half maximum to its centroid */
    double misfit;    /* RMS of echo minus term near its middle, over its peak */
    double tail;      /* how far the echo is above the term further out, at most, over its peak */
};

/* This is the pulse h, as detectors know it. The struct is constant after finder_learn. */
struct finder {
    int seen;       /* the table `shape` reaches the peak of h; else no echo is found */
    double peak;    /* of h */
    double width;   /* of h, full at half maximum */
    double signal;  /* of one count */
    double noise;   /* sigma of a sample: the receiver's noise, and the rounding to counts */
    double limit;   /* a sample from here on is limited */
    uint32_t blind; /* samples without signal after a limited one */
    double metre;   /* range of one sample */
    struct finder_spread spread[FINDER_SPREADS]; /* by growing tilt; the first is a plane that is hit head on */
    /* lead[k]: samples from the place where h rises through exp(-v v / 2) of its peak, v = k FINDER_LEAD_STEP, to the
     * centroid of h. */
    double lead[FINDER_LEADS];
    int gaussian;                 /* h is a Gaussian */
    double middle;                /* from the centroid of h to its middle, in widths */
    double reach[2];              /* where a term ends, in sigmas before and after its middle */
    double area, variance, third; /* of h: its sum over the samples, and central moments */
    double shape[FINDER_SHAPE];   /* h over its peak */
    uint32_t top;                 /* entry of shape: its first maximum above a half */
    double log_shape[FINDER_SHAPE], log_slope[FINDER_SHAPE]; /* logarithm of shape, and its derivative by widths */
};

/* Returns the value of a table of h at `widths` after its centroid. */
static inline double finder_table(const double table[FINDER_SHAPE], double widths)
{
    double place = (widths + FINDER_SHAPE_LEAD) * (1.0 / FINDER_SHAPE_STEP);
    if (!(place >= 0.0 && place < FINDER_SHAPE - 1)) return 0.0;
    uint32_t k = (uint32_t)place;
    return table[k] + (place - k) * (table[k + 1] - table[k]);
}
/* Returns the value of a term of peak 1, d of its sigmas after its middle. finder_fall returns minus the derivative of
 * this value by d. */
double finder_value(const struct finder *finder, double d);
double finder_fall(const struct finder *finder, double d, double value);
/* Returns how long before its centroid h has `part` of its peak. */
double finder_lead(const struct finder *finder, double part);

/* Fills `finder` from signals that the waveform makes. All of the waveform but its finder must be set before. */
void finder_learn(const struct waveform *waveform, struct finder *finder);
/* Interpolates the figures of the echo whose term has this sigma, or of the echo of this width. */
enum finder_key { FINDER_SIGMA, FINDER_WIDTH };
void finder_find(const struct finder *finder, enum finder_key key, double value, struct finder_spread *spread);

enum finder_mark { FINDER_PLAIN, FINDER_LIMITED, FINDER_BLIND };

/* The samples of one window. A blind sample repeats the sample before it, so that no echo seems to begin after it. */
struct finder_run {
    const struct finder *finder;
    const double *y; /* [n] */
    uint32_t n;
    const uint8_t *mark; /* [n] enum finder_mark; NULL: all are plain */
    double first;        /* number of its first sample on the pulse's grid */
};

/* A local maximum that noise does not explain. Samples from .. to - 1 reach to the minima on both sides of it. */
struct finder_peak {
    uint32_t top, from, to;
};
/* Returns whether its top was limited, so that its height is not known. */
static inline int finder_limited(const struct finder_run *run, const struct finder_peak *peak)
{
    return run->mark != NULL && run->mark[peak->top] != FINDER_PLAIN;
}
/* Finds maxima of at least `least`, and keeps the first `most` of them. Returns the number of all of them. */
uint32_t finder_peaks(const struct finder_run *run, double least, struct finder_peak *peak, uint32_t most);
/* Returns the largest signal about a top sample. *place: where it is. */
double finder_top(const struct finder_run *run, uint32_t top, double *place);
/* Finds where the signal crosses half of the peak on both sides of its top, within the peak's samples. On a side
 * without a crossing, the crossing of the other side is mirrored. Returns how many sides have a crossing. */
int finder_half(const struct finder_run *run, const struct finder_peak *peak, double height, double side[2]);

struct finder_list {
    struct waveform_echo *echo;
    uint32_t most, n, crowded;
};
struct finder_found {
    double at, peak, width;
    int saturated;
};
/* Returns a limit that a mean of n squares of noise exceeds once in 30,000 times. */
double finder_noise2(const struct finder *finder, double n);

/* A sum of terms. `open`: bit j is set where component j is limited, has its top at the window's end, or falls to half
 * of its peak on neither side. */
struct finder_mix {
    uint32_t n, open, limited; /* limited: bit j is set where component j is limited */
    uint32_t seen;             /* bit j is set where component j is limited, and its top sample reaches the level */
    struct finder_term g[FINDER_MIX];
    double chi2;
};

/* Adds an echo. The echo's deviation is the RMS of the samples minus h at the echo, over the echo's peak. The other
 * components of its mixture are subtracted first. */
void finder_add(const struct finder_run *run, const struct finder_found *found, const struct finder_mix *mix,
                uint32_t self, struct finder_list *list);
/* Adds the echo that term `self` of a mixture stands for, if its peak reaches the level of detection. Where a limited
 * sample reaches the level, the light does: a fit that says less gives the peak of the level. */
void finder_add_term(const struct finder_run *run, const struct finder_mix *mix, uint32_t self,
                     struct finder_list *list);

/* Fits one term through the samples near a peak. Returns 1 where it explains the samples from `peak`'s first to its
 * last. */
int finder_fit(const struct finder_run *run, const struct finder_peak *peak, struct finder_term *g);
/* Makes the same fit without that decision. Returns the RMS of the residual, or -1 where the fit fails. */
double finder_fit_near(const struct finder_run *run, const struct finder_peak *peak, struct finder_term *g);

/* A mixture is fitted to the samples lo .. hi; variance: of one sample. */
struct finder_task {
    const struct finder_run *run;
    uint32_t lo, hi;
    double variance;
};
/* Moves the components to the least sum of squares near by, which becomes chi2. */
void finder_mix_fit(const struct finder_task *task, struct finder_mix *mix);
/* Fills rest[hi - lo + 1] with the part of the samples that the components don't explain. */
void finder_mix_rest(const struct finder_task *task, const struct finder_mix *mix, double *rest);
/* Begins with one component for each peak. adds: more components follow while the residual could have another echo. The
 * height of a limited top is estimated from the time for which the top is limited. Where the receiver went blind after
 * the top, the height is estimated from the rising flank. */
void finder_decompose(const struct finder_run *run, const struct finder_peak *peak, uint32_t n, int adds,
                      struct finder_mix *mix);

void finder_threshold(const struct finder_run *run, struct finder_list *list);
void finder_fraction(const struct finder_run *run, struct finder_list *list);

#endif
