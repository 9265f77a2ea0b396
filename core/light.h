/* SPDX-License-Identifier: MIT */
/* The speed of light in vacuum, in metres per second. A range is half the distance that light goes
 * between emission and echo. */
#ifndef CORE_LIGHT_H
#define CORE_LIGHT_H

static const double LIGHT_SPEED_M_S = 299792458.0;

#endif
