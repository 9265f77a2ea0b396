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
static void excess(double scale, float most, const float *restrict steep, uint32_t n, double *restrict range_m)
{
    for (uint32_t i = 0; i < n; i++)
        range_m[i] += range_m[i] * (scale * (double)(steep[i] < most ? steep[i] : most));
}

void kernel_excess(const struct beam *beam, const float *steep, uint32_t n, double *range_m)
{
    double s2 = beam->slope * beam->slope;
    if (s2 == 0.0) return;
    excess(beam_plane_excess(beam, 1.0, 1.0), (float)(0.25 / s2), steep, n, range_m);
}
