/* SPDX-License-Identifier: MIT */
/* The map's Taylor polynomial about its centre, in the form whose series converges fastest. Used within
 * core/georef. In: differences in prcs from the centre (metres). Out: differences from the anchor, in units
 * of the CRS.
 *   space     three polynomials of x, y, z: a metric frame to a grid, a grid to ECEF
 *   flat      two of x, y; heights stay what they are: a grid to another grid, a UTM grid to geodetic
 *   meridian  geodetic from a metric frame or a UPS grid. Let e, n, u be the point's east, north, up from the
 *             centre. The point's distance from the Earth's axis is
 *                 s = hypot(a, e),  a = s0 + u cos lat - n sin lat,
 *             and its longitude differs from the centre's by 2 atan(e / (s + a)). Turned back into the
 *             centre's meridian, the point moves by s - a away from the axis. In that meridian latitude and height are
 *             polynomials of n and u alone, which are smooth at the pole. A polynomial for longitude would
 *             have an error of (scene / s0)^4 s0. A UPS grid has the pole in its plane: the same holds with
 *             a = s0 -+ n. */
#ifndef CORE_GEOREF_POLYNOMIAL_H
#define CORE_GEOREF_POLYNOMIAL_H

#include <stddef.h>

#include "core/georef/geographiclib_shim.h"

/* Terms x^a y^b z^c of degree 1 to 6 in order of degree, then of falling a, then of falling b: 3, 6, 10, 15,
 * 21, 28. */
enum { POLYNOMIAL_DEGREE = 6, POLYNOMIAL_TERMS = 83, POLYNOMIAL_USED = 19, POLYNOMIAL_PLANE = 20 };

enum polynomial_form { POLYNOMIAL_SPACE, POLYNOMIAL_FLAT, POLYNOMIAL_MERIDIAN };

struct polynomial {
    enum polynomial_form form;
    double c[3][POLYNOMIAL_TERMS]; /* per output; units of the CRS per metre^degree; meridian: x, y, z are 0, n, u */
    double half_m;                 /* fitted within +-half_m on each axis; 0: there is none */
    /* Terms of degree 1 to 5 in two variables, p^d, p^(d-1) q, ..., q^d: flat, of x and y for both outputs;
     * meridian, of n and u for latitude and height. */
    double plane[2][POLYNOMIAL_PLANE];
    struct shim_meridian meridian;
};

/* Fits within +-half_m about the map's centre. */
void polynomial_fit(const struct shim_map *map, enum polynomial_form form, double half_m, struct polynomial *out);

/* Returns whether the polynomial has this order: 1 to 3, and in the form POLYNOMIAL_FLAT also 5. */
int polynomial_has_order(const struct polynomial *p, int order);

/* A bound of the terms above `order`, within radius_m and height_m of the centre; weight: metres on the ground per unit
 * of each output. INFINITY beyond half_m, where the series does not converge fast, and where the polynomial does not
 * have this order. In the form POLYNOMIAL_MERIDIAN the bound is INFINITY, too, where points may lie on the Earth's
 * axis. */
double polynomial_bound_m(const struct polynomial *p, int order, double radius_m, double height_m,
                          const double weight[3]);

/* Computes n differences from the anchor. out may be the arrays of d. */
void polynomial_apply(const struct polynomial *p, int order, size_t n, struct vec3_in d, struct vec3_out out);

#endif
