/* The speed of light, in vacuum: ranges are what its way back and forth takes, halved. */
#ifndef CORE_LIGHT_H
#define CORE_LIGHT_H

static const double LIGHT_SPEED_M_S = 299792458.0;

#endif
