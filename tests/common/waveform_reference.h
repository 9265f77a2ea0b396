/* SPDX-License-Identifier: MIT */
/* Waveforms by many sub-rays, summed one by one with a Gaussian pulse of its own, and shapes that fill a footprint. */
#ifndef TESTS_COMMON_WAVEFORM_REFERENCE_H
#define TESTS_COMMON_WAVEFORM_REFERENCE_H

#include <stdint.h>

#include "core/footprint.h"
#include "core/waveform.h"

enum { WAVEREF_RAYS = 100000, WAVEREF_SAMPLES = 512 };
#define WAVEREF_SAMPLE_S   1e-9
#define WAVEREF_PULSE_S    2e-9
#define WAVEREF_SIGMA_S    (WAVEREF_PULSE_S / 2.3548200450309493)
#define WAVEREF_METRES_1_S (0.5 * 299792458.0)
#define WAVEREF_FAR_M      100.0

/* Signals of samples first .. first + n. */
struct waveref_window {
    double first;
    uint32_t n;
    double p[WAVEREF_SAMPLES];
};
/* Empties a window that has room for returns from from_m to to_m, and for the pulse around them. */
void waveref_open(struct waveref_window *window, double from_m, double to_m);
void waveref_add(struct waveref_window *window, double range_m, double weight);
/* Sets place i of n in the unit disc, on a spiral of equal energies (Vogel 1979). */
void waveref_place(uint32_t i, uint32_t n, double *x, double *y);
/* Returns the RMS of the differences of a and b, in counts of 12 bits, with full scale at the peak of b. */
double waveref_counts(const struct waveref_window *a, const struct waveref_window *b);

/* Returns the spec of such a pulse: 12 bits, a full scale of 1, no noise. */
struct waveform_spec waveref_spec(void);
void waveref_fill(const struct waveform *w, const struct waveform_return *r, uint32_t n,
                  const struct waveref_window *like, struct waveref_window *out);

/* Ranges by place in the unit disc, m, about WAVEREF_FAR_M. Planes are at 60 and 85 degrees, in a beam of 0.35 mrad. */
enum {
    WAVEREF_PLANE_60,
    WAVEREF_PLANE_85,
    WAVEREF_STEP,
    WAVEREF_WEDGE,
    WAVEREF_SPHERE,
    WAVEREF_FOLIAGE,
    WAVEREF_SHAPES
};
struct waveref_shape {
    const char *name;
    double (*range_m)(double x, double y);
};
extern const struct waveref_shape waveref_shape[WAVEREF_SHAPES];
void waveref_by_rays(const struct waveref_shape *shape, struct waveref_window *out);
/* Fills the pattern's sub-rays as points. Returns how many there are. */
uint32_t waveref_rings(const struct waveref_shape *shape, uint32_t rings, struct waveform_return *r);
/* Fills a shape without sub-rays: a plane as one return, a step or wedge as its two sides. Returns how many; 0: it
 * is another shape. */
uint32_t waveref_parts(int shape, struct waveform_return r[2]);

#endif
