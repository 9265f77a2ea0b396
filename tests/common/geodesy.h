/* SPDX-License-Identifier: MIT */
/* WGS 84 in long double, from definitions. The code shares nothing with GeographicLib, and is the reference for our
 * positions.
 *
 * Ellipsoid: NIMA TR8350.2. Transverse Mercator: the Gauss-Krueger projection is the analytic function that equals the
 * meridian's arc on the central meridian. The function is evaluated at the complex isometric latitude
 * (psi + i lambda): a fixed point gives the complex latitude, and Gauss-Legendre quadrature the arc. Polar
 * stereographic: its closed form. A point takes about 20 us. */
#ifndef TESTS_COMMON_GEODESY_H
#define TESTS_COMMON_GEODESY_H

#include <complex.h>
#include <math.h>

#define GEODESY_PI 3.14159265358979323846264338327950288L
#define GEODESY_A  6378137.0L
#define GEODESY_F  (1.0L / 298.257223563L)
#define GEODESY_E2 (GEODESY_F * (2.0L - GEODESY_F))

struct geodesy {
    long double lat_rad, lon_rad, height_m;
};

/* lat and lon are degrees; d is east, north and up from there. */
void geodesy_ecef(double lat_deg, double lon_deg, double height_m, const double d[3], long double p[3]);

enum { GEODESY_NODES = 20 };

/* Writes the easting from the central meridian and the northing from the equator, scaled by 0.9996. */
void geodesy_utm(struct geodesy at, int zone, long double *x, long double *y);

/* Writes the position in a system by its EPSG code (4978, 4979, 326zz, 327zz, 32661, 32761), with false origin: metres,
 * or degrees and metres. */
void geodesy_position(int epsg, const long double p_ecef[3], long double out[3]);

/* Returns the distance on the ground between anchor + d and such a position. */
double geodesy_error_m(int epsg, const double anchor[3], const double d[3], const long double p_ecef[3]);

#endif
