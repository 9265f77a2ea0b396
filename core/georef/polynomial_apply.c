/* SPDX-License-Identifier: MIT */
#include "core/georef/polynomial_kernels.h"

POLYNOMIAL_KERNELS(VEC_CLONES, native)

static void apply_block(const struct polynomial_kernels *kernels, const struct polynomial *p, int order, size_t n,
                        struct vec3_in d, double result[3][POLYNOMIAL_BLOCK])
{
    switch (p->form) {
    case POLYNOMIAL_SPACE:
        for (int k = 0; k < 3; k++)
            kernels->space[order](p->c[k], n, d, result[k]);
        break;
    case POLYNOMIAL_FLAT:
        for (int k = 0; k < 2; k++)
            kernels->flat[order](p->plane[k], n, d, result[k]);
        memcpy(result[2], d.z, n * sizeof *d.z);
        break;
    case POLYNOMIAL_MERIDIAN:
        kernels->meridian[order](p, n, d, result);
        break;
    }
}

void polynomial_apply_with(const struct polynomial_kernels *kernels, const struct polynomial *p, int order, size_t n,
                           struct vec3_in d, struct vec3_out out)
{
    double result[3][POLYNOMIAL_BLOCK];
    for (size_t at = 0; at < n; at += POLYNOMIAL_BLOCK) {
        size_t m = n - at < POLYNOMIAL_BLOCK ? n - at : POLYNOMIAL_BLOCK;
        apply_block(kernels, p, order, m, (struct vec3_in){d.x + at, d.y + at, d.z + at}, result);
        memcpy(out.x + at, result[0], m * sizeof *out.x);
        memcpy(out.y + at, result[1], m * sizeof *out.y);
        memcpy(out.z + at, result[2], m * sizeof *out.z);
    }
}

void polynomial_apply(const struct polynomial *p, int order, size_t n, struct vec3_in d, struct vec3_out out)
{
    polynomial_apply_with(&native, p, order, n, d, out);
}
