/* Arithmetic for pulses with a footprint. */
#include <math.h>

#include "core/cast/kernels.h"
#include "core/vecmath.h"

VEC_CLONES
static void incidence(const double *restrict tri, uint32_t n_triangles, const uint32_t *restrict prim,
                      const double *restrict dx, const double *restrict dy, const double *restrict dz, uint32_t n,
                      double *restrict cosine)
{
    for (uint32_t i = 0; i < n; i++) {
        int64_t at = (int64_t)(prim[i] < n_triangles ? prim[i] : n_triangles) * 4;
        double nx = tri[at], ny = tri[at + 1], nz = tri[at + 2];
        double along = nx * dx[i] + ny * dy[i] + nz * dz[i], length2 = nx * nx + ny * ny + nz * nz;
        double c = sqrt(along * along / length2);
        cosine[i] = c < 1.0 ? c : 1.0; /* a miss: all is NaN */
    }
}

void kernel_incidence(const struct bvh *bvh, const uint32_t *prim, const double *dx, const double *dy,
                      const double *dz, uint32_t n, double *cosine)
{
    incidence((const double *)bvh->triangle, bvh->scene->n_triangles, prim, dx, dy, dz, n, cosine);
}

VEC_CLONES
static void limits(double exit2, double slope2, const double *restrict range_m, const double *restrict cosine,
                   uint32_t n, double *restrict limit_m)
{
    for (uint32_t i = 0; i < n; i++) {
        double c = cosine[i] > 1e-3 ? cosine[i] : 1e-3;
        double radius_m = sqrt(exit2 + slope2 * range_m[i] * range_m[i]);
        double limit = range_m[i] + radius_m * (4.0 + 3.0 * sqrt(1.0 - c * c) / c);
        limit_m[i] = limit == limit ? limit : (double)INFINITY;
    }
}

void kernel_limits(const struct beam *beam, const double *range_m, const double *cosine, uint32_t n, double *limit_m)
{
    limits(beam->exit_radius_m * beam->exit_radius_m, beam->slope * beam->slope, range_m, cosine, n, limit_m);
}
