/* Arithmetic for pulses with a footprint. */
#include <math.h>

#include "core/cast/kernels.h"
#include "core/vecmath.h"

void kernel_steep(const struct bvh *bvh, uint32_t prim, const double dir[3], float *steep)
{
    double cosine;
    kernel_cosines(bvh, &prim, &dir[0], &dir[1], &dir[2], 1, &cosine);
    *steep = prim < bvh->scene->n_triangles ? (float)(1.0 / (cosine * cosine)) : NAN;
}

double kernel_limit(const struct beam *beam, double range_m, float steep)
{
    double s = steep < 1e6f ? (double)steep : 1e6;
    return isnan(range_m) ? (double)INFINITY : range_m + beam_radius(beam, range_m) * (4.0 + 3.0 * sqrt(s));
}

VEC_CLONES
static void excess(const double *restrict term, float most, const float *restrict steep, uint32_t n,
                   double *restrict range_m)
{
    for (uint32_t i = 0; i < n; i++) {
        double x = (double)(steep[i] < most ? steep[i] : most);
        range_m[i] += range_m[i] * x * (term[0] + x * (term[1] + x * term[2]));
    }
}

void kernel_excess(const struct beam *beam, const float *steep, uint32_t n, double *range_m)
{
    double term[3], s2 = beam->slope * beam->slope;
    if (s2 == 0.0) return;
    beam_plane_series(beam, term);
    excess(term, (float)(0.25 / s2), steep, n, range_m);
}
