/* SPDX-License-Identifier: MIT */
/* Rounds limits for messages, to a number of digits and towards the allowed side, so that a user who takes the figure
 * of the message isn't refused again. All limits are above 0. A limit within 1e-9 (relative) of a rounded figure
 * becomes that figure. */
#ifndef CORE_DIGITS_H
#define CORE_DIGITS_H

#include <math.h>

/* Returns the value of one step of the last digit if x, above 0, is written with this number of digits: 0.01 for 1.23
 * and 3 digits. */
static inline double digits_place(double x, int digits)
{
    return pow(10.0, floor(log10(x)) + 1.0 - digits);
}

static inline double digits_up(double x, int digits)
{
    const double place = digits_place(x, digits);
    return ceil(x / place * (1.0 - 1e-9)) * place;
}

static inline double digits_down(double x, int digits)
{
    const double place = digits_place(x, digits);
    return floor(x / place * (1.0 + 1e-9)) * place;
}

#endif
