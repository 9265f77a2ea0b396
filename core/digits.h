/* SPDX-License-Identifier: MIT */
/* Limits as a text names them: rounded to so many digits, towards the side that is allowed. A user who takes the figure
 * isn't refused again. A limit above 0 that is such a number but for 1e-9 of it stays that number. */
#ifndef CORE_DIGITS_H
#define CORE_DIGITS_H

#include <math.h>

/* The place of the last of so many digits. */
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
