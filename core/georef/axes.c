/* SPDX-License-Identifier: MIT */
/* georef_axes: the rotation that the map makes at its centre. */
#include <string.h>

#include "core/georef/state.h"
#include "core/mat3.h"

/* Over this distance, nanometres of rounding are 1e-10 rad. Differences to both sides are exact for a quadratic
 * map. */
static const double STEP_M = 100.0;

/* Takes a difference from the anchor in degrees, degrees and metres to a place in ECEF. */
static void take_to_ecef(const double anchor[3], const double d[3], double p_ecef[3])
{
    double unused[9];
    shim_ecef(anchor[0] + d[0], anchor[1] + d[1], anchor[2] + d[2], p_ecef, unused);
}

/* Column k of the Jacobian is the image of a metre along axis k. Degrees have no even steps near a pole. ECEF has them
 * everywhere: there the difference is turned to east, north and up at the anchor. */
static void jacobian(const struct georef *georef, double j[9])
{
    double at_m[3], enu[9];
    const int in_degrees = georef->crs == GEOREF_GEODETIC;
    if (in_degrees) shim_ecef(georef->anchor[0], georef->anchor[1], georef->anchor[2], at_m, enu);
    for (int k = 0; k < 3; k++) {
        double out[2][3], step[3];
        for (int side = 0; side < 2; side++) {
            double d[3] = {0.0, 0.0, 0.0};
            d[k] = side == 0 ? -STEP_M : STEP_M;
            shim_map_forward(georef->map, 1, (struct vec3_in){&d[0], &d[1], &d[2]},
                             (struct vec3_out){&out[side][0], &out[side][1], &out[side][2]});
            if (in_degrees) take_to_ecef(georef->anchor, out[side], out[side]);
        }
        for (int i = 0; i < 3; i++)
            step[i] = (out[1][i] - out[0][i]) / (2.0 * STEP_M);
        if (in_degrees) mat3_apply_transposed(enu, (const double[3]){step[0], step[1], step[2]}, step);
        for (int i = 0; i < 3; i++)
            j[3 * i + k] = step[i];
    }
}

/* Makes the transposed inverse, which is the matrix of cofactors over the determinant. */
static int invert(const double m[9], double out[9])
{
    for (int i = 0; i < 3; i++)
        for (int k = 0; k < 3; k++) {
            int a = (i + 1) % 3, b = (i + 2) % 3, c = (k + 1) % 3, d = (k + 2) % 3;
            out[3 * i + k] = m[3 * a + c] * m[3 * b + d] - m[3 * a + d] * m[3 * b + c];
        }
    double det = m[0] * out[0] + m[1] * out[1] + m[2] * out[2];
    for (int i = 0; i < 9; i++)
        out[i] /= det;
    return det > 0.1; /* false for NaN */
}

/* The map is a rotation with some stretching before or after it. The rotation alone is the Jacobian's polar factor.
 * Newton's iteration (Higham 1986) finds it, and converges quadratically, since the Jacobian is near a rotation. */
void georef_axes(const struct georef *georef, double rotation[9])
{
    double m[9], other[9];
    if (!georef_has_map(georef)) {
        memcpy(rotation, georef->rotation, sizeof m);
        return;
    }
    memcpy(rotation, mat3_unit, sizeof m);
    jacobian(georef, m);
    for (int n = 0; n < 8; n++) {
        if (!invert(m, other)) return;
        for (int i = 0; i < 9; i++)
            m[i] = 0.5 * (m[i] + other[i]);
    }
    memcpy(rotation, m, sizeof m);
}
