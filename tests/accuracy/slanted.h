/* SPDX-License-Identifier: MIT */
/* Slanted surfaces in a beam, and the width of their echo by the definition in core/footprint.h: many sub-rays meet the
 * plane one by one. For tests of attributes. */
#ifndef TESTS_ACCURACY_SLANTED_H
#define TESTS_ACCURACY_SLANTED_H

#include "tests/accuracy/lit_plates.h"

#define CNS_PER_M (2e11 / 299792458.0)
#define FULL2     (8.0 * M_LN2) /* square of the full width at half maximum of a Gaussian, in sigma^2 */

/* Pulses so close together that they all see the same. */
extern const struct beam_view AHEAD;
enum { MOST_CUTS = 3 };

/* A plane n . p = d seen from the origin, as far as its points lie beyond all cuts: c . p >= e. */
struct face {
    double n[3], d;
    int n_cuts;
    double cut[MOST_CUTS][4];
};

/* Writes mean and variance of the ranges of sub-rays on a Vogel spiral, equal energy each, that meet the face. Returns
 * their share. */
double spread(const struct beam *beam, const double dir[3], const struct face *f, double *mean, double *variance);

double width_of(double pulse_m, double variance);

/* Makes a quad on the plane through (0, range, 0). The plane is slanted by i, about an axis that is turned by `about`
 * from vertical. u and v are where the corners lie along the plane's axes, v along the slant. */
struct scene *slanted(double range_m, double i, double about, const double u[2], const double v[2], struct face *face);

void open_attributes(struct beam_rig *rig, struct scene *scene, const struct beam_view *view, double pulse_s);

/* The bound is half a count, 0.02 % for the scatter of 40,000 rays, and 0.7 b^2. The closed form is of first order in
 * b = s tan i, so it lacks about b^2 / 2 of the width. With E sin^2 rho^2 = 0.1715 the series of 1 / (1 - b rho sin
 * phi) gives (3 * 0.0701 - 0.1715^2) / 0.1715 / 2 = 0.53 b^2 of the standard deviation. */
void check_width(double told_cns, double want_cns, double b, double slack);

/* Returns the error beyond the wire's rounding, as a share of the width. */
double excess(double told_cns, double want_cns);

#endif
