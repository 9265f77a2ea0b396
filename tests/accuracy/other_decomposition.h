/* SPDX-License-Identifier: MIT */
/* Echoes as HELIOS++ finds them, from its published description (L. Winiwarter et al., Virtual laser scanning with
 * HELIOS++, Remote Sensing of Environment 269, 2022): a sample is an echo, at its own range, if none in a window around
 * it is larger. The echo's width is that of one Gaussian with an offset, a + b exp(-((x - c) / d)^2), fitted to the
 * samples. The code shares nothing with the program: the fit is a plain Levenberg and Marquardt with numeric
 * derivatives. */
#ifndef TESTS_ACCURACY_OTHER_DECOMPOSITION_H
#define TESTS_ACCURACY_OTHER_DECOMPOSITION_H

#include <stdint.h>

struct other_echo {
    uint32_t sample;                      /* of the maximum */
    double offset, peak, centre, width_e; /* a, b, c, d; in samples and in the signal's units */
};

/* n samples; side: the window reaches so many to each side; fit: about so many samples are fitted. */
uint32_t other_decompose(const double *y, uint32_t n, double least, uint32_t side, uint32_t fit,
                         struct other_echo *echo, uint32_t most);

#endif
