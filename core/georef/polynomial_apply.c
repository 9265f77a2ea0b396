#include "core/georef/polynomial_kernels.h"

enum { BLOCK = 128 };

POLYNOMIAL_KERNELS(VEC_CLONES, native)

static void apply_block(const struct polynomial_kernels *kernels, const struct polynomial *p, int order, size_t n,
                        const double *x, const double *y, const double *z, double result[3][BLOCK])
{
    switch (p->form) {
    case POLYNOMIAL_SPACE:
        for (int k = 0; k < 3; k++)
            kernels->space[order](p->c[k], n, x, y, z, result[k]);
        break;
    case POLYNOMIAL_FLAT:
        for (int k = 0; k < 2; k++)
            kernels->flat[order](p->plane[k], n, x, y, result[k]);
        memcpy(result[2], z, n * sizeof *z);
        break;
    case POLYNOMIAL_MERIDIAN:
        kernels->meridian[order](p, n, x, y, z, result[0], result[1], result[2]);
        break;
    }
}

void polynomial_apply_with(const struct polynomial_kernels *kernels, const struct polynomial *p, int order, size_t n,
                           const double *x, const double *y, const double *z, double *out_x, double *out_y,
                           double *out_z)
{
    double result[3][BLOCK];
    for (size_t at = 0; at < n; at += BLOCK) {
        size_t m = n - at < BLOCK ? n - at : BLOCK;
        apply_block(kernels, p, order, m, x + at, y + at, z + at, result);
        memcpy(out_x + at, result[0], m * sizeof *out_x);
        memcpy(out_y + at, result[1], m * sizeof *out_y);
        memcpy(out_z + at, result[2], m * sizeof *out_z);
    }
}

void polynomial_apply(const struct polynomial *p, int order, size_t n, const double *x, const double *y,
                      const double *z, double *out_x, double *out_y, double *out_z)
{
    polynomial_apply_with(&native, p, order, n, x, y, z, out_x, out_y, out_z);
}
