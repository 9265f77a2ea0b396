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

VEC_CLONES
static void limits(float exit2, float slope2, const double *restrict range_m, const float *restrict steep, uint32_t n,
                   float *restrict limit_m)
{
    for (uint32_t i = 0; i < n; i++) {
        float range = (float)range_m[i], s = steep[i] < 1e6f ? steep[i] : 1e6f;
        float limit = range + sqrtf(exit2 + slope2 * range * range) * (4.0f + 3.0f * sqrtf(s));
        limit_m[i] = limit == limit ? limit : (float)INFINITY;
    }
}

void kernel_limits(const struct beam *beam, const double *range_m, const float *steep, uint32_t n, float *limit_m)
{
    limits((float)(beam->exit_radius_m * beam->exit_radius_m), (float)(beam->slope * beam->slope), range_m, steep, n,
           limit_m);
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
