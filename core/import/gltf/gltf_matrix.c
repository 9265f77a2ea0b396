/* SPDX-License-Identifier: MIT */
#include "core/import/gltf/gltf_matrix.h"

#include <string.h>

void gltf_multiply(const gltf_matrix a, const gltf_matrix b, gltf_matrix out)
{
    gltf_matrix m;
    for (int i = 0; i < 3; i++)
        for (int k = 0; k < 4; k++)
            m[i][k] = a[i][0] * b[0][k] + a[i][1] * b[1][k] + a[i][2] * b[2][k] + (k == 3 ? a[i][3] : 0.0);
    memcpy(out, m, sizeof m);
}

void gltf_apply(const gltf_matrix m, const double v[3], double out[3])
{
    const double x = v[0], y = v[1], z = v[2];
    for (int i = 0; i < 3; i++)
        out[i] = m[i][0] * x + m[i][1] * y + m[i][2] * z + m[i][3];
}

bool gltf_is_mirrored(const gltf_matrix m)
{
    return m[0][0] * (m[1][1] * m[2][2] - m[1][2] * m[2][1]) - m[0][1] * (m[1][0] * m[2][2] - m[1][2] * m[2][0]) +
               m[0][2] * (m[1][0] * m[2][1] - m[1][1] * m[2][0]) <
           0.0;
}

bool gltf_compose(const double t[3], const double r[4], const double s[3], gltf_matrix out)
{
    const double n2 = r[0] * r[0] + r[1] * r[1] + r[2] * r[2] + r[3] * r[3];
    if (!(n2 > 1e-12)) return false;
    const double k = 2.0 / n2, x = r[0], y = r[1], z = r[2], w = r[3];
    const double turn[3][3] = {{1.0 - k * (y * y + z * z), k * (x * y - z * w), k * (x * z + y * w)},
                               {k * (x * y + z * w), 1.0 - k * (x * x + z * z), k * (y * z - x * w)},
                               {k * (x * z - y * w), k * (y * z + x * w), 1.0 - k * (x * x + y * y)}};
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j < 3; j++)
            out[i][j] = turn[i][j] * s[j];
        out[i][3] = t[i];
    }
    return true;
}
