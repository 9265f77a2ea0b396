/* SPDX-License-Identifier: MIT */
#include "tests/guest/plan_room.h"

#include <math.h>

double plan_room_range_m(double left_rad)
{
    static const double at[2] = {0.31, -0.42}, low[2] = {-4.37, -6.21}, high[2] = {5.83, 3.94};
    const double azimuth = 30 * acos(-1) / 180 - left_rad; /* from north, which is y, clockwise */
    const double dir[2] = {sin(azimuth), cos(azimuth)};
    double range = INFINITY;
    for (int k = 0; k < 2; k++) {
        if (fabs(dir[k]) < 1e-12) continue;
        range = fmin(range, ((dir[k] > 0 ? high[k] : low[k]) - at[k]) / dir[k]);
    }
    return range;
}
