/* SPDX-License-Identifier: MIT */
/* Degrees and radians. Inside the program angles are in radians; degrees come from files and go to people. */
#ifndef CORE_ANGLE_H
#define CORE_ANGLE_H

#include <math.h>

static inline double angle_rad(double deg)
{
    return deg * M_PI / 180.0;
}

static inline double angle_deg(double rad)
{
    return rad * 180.0 / M_PI;
}

#endif
