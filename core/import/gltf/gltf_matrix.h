/* SPDX-License-Identifier: MIT */
/* Nodes and joints have affine matrices, in double. */
#ifndef CORE_IMPORT_GLTF_GLTF_MATRIX_H
#define CORE_IMPORT_GLTF_GLTF_MATRIX_H

#include <stdbool.h>

/* Rows of an affine matrix: x' = row . (x, 1). */
typedef double gltf_matrix[3][4];

void gltf_multiply(const gltf_matrix a, const gltf_matrix b, gltf_matrix out);
void gltf_apply(const gltf_matrix m, const double v[3], double out[3]);
/* Whether the determinant is negative: such a matrix turns the winding of triangles round. */
bool gltf_is_mirrored(const gltf_matrix m);
/* Translation, rotation (x, y, z, w) and scale as a matrix. False: r is no rotation. */
bool gltf_compose(const double t[3], const double r[4], const double s[3], gltf_matrix out);

#endif
