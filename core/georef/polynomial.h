/* The map's Taylor polynomial about its centre. Private to core/georef. */
#ifndef CORE_GEOREF_POLYNOMIAL_H
#define CORE_GEOREF_POLYNOMIAL_H

#include <stddef.h>

#include "core/georef/geographiclib_shim.h"

/* Terms x^a y^b z^c of degree 1 to 6 in order of degree, then of falling a, then of falling b: 3, 6, 10, 15, 21, 28. */
enum { POLYNOMIAL_DEGREE = 6, POLYNOMIAL_TERMS = 83, POLYNOMIAL_USED = 19 };

struct polynomial {
    double c[3][POLYNOMIAL_TERMS]; /* per output; units of the CRS per metre^degree */
    double half_m;                 /* fitted within +-half_m on each axis; 0: there is none */
};

/* Fits within +-half_m about the map's centre. */
void polynomial_fit(const struct shim_map *map, double half_m, struct polynomial *out);

/* What is left out above `order` (1 to 3), within radius_m and height_m of the centre; weight: metres on the ground per
 * unit of each output. INFINITY beyond half_m, and where the series does not settle. */
double polynomial_bound_m(const struct polynomial *p, int order, double radius_m, double height_m,
                          const double weight[3]);

/* In place is allowed. */
void polynomial_apply(const struct polynomial *p, int order, size_t n, const double *x, const double *y,
                      const double *z, double *out_x, double *out_y, double *out_z);

#endif
