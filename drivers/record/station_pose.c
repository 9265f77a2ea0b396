/* SPDX-License-Identifier: MIT */
#include "drivers/record/station_pose.h"

#include <math.h>
#include <string.h>

#include "core/mat3.h"
#include "core/vecmath.h"
#include "drivers/protocol/native.h"

void station_pose_of(const struct scanhead_info *info, struct station_pose *pose)
{
    memcpy(pose->rotation, info->rotation, sizeof pose->rotation);
    if (info->geo) mat3_multiply(info->axes, info->rotation, pose->rotation);
    memcpy(pose->shift_m, info->geo ? info->anchor : info->station_m, sizeof pose->shift_m);
}

void station_pose_level(const struct station_pose *pose, double lat_deg, double lon_deg, double east_north_m[2])
{
    const double m_deg = EARTH_RADIUS_M * NATIVE_RAD_PER_DEG;
    east_north_m[0] = remainder(lon_deg - pose->shift_m[1], 360) * m_deg * cos(lat_deg * NATIVE_RAD_PER_DEG);
    east_north_m[1] = (lat_deg - pose->shift_m[0]) * m_deg;
}

VEC_CLONES void station_pose_reverse_all(const struct station_pose *restrict pose, int n, double *restrict x,
                                         double *restrict y, double *restrict z)
{
    for (int i = 0; i < n; i++) {
        double p[3] = {x[i], y[i], z[i]};
        station_pose_reverse(pose, p);
        x[i] = p[0];
        y[i] = p[1];
        z[i] = p[2];
    }
}

VEC_CLONES void station_pose_forward_all(const struct station_pose *restrict pose, int n, double *restrict x,
                                         double *restrict y, double *restrict z)
{
    for (int i = 0; i < n; i++) {
        double p[3] = {x[i], y[i], z[i]};
        station_pose_forward(pose, p);
        x[i] = p[0];
        y[i] = p[1];
        z[i] = p[2];
    }
}

/* The rotation gives the products 4 q[i] q[j] of all components of the quaternion q. Row i of these products is q times
 * 4 q[i]. So the row divided by its length is q, up to the sign. The row of the largest component is taken, so that no
 * figure is the difference of near numbers (Shepperd 1978). */
void station_pose_quaternion(const struct station_pose *pose, double q[4])
{
    const double *r = pose->rotation;
    const double four[4] = {1 + r[0] + r[4] + r[8], 1 + r[0] - r[4] - r[8], 1 - r[0] + r[4] - r[8],
                            1 - r[0] - r[4] + r[8]};
    int k = 0;
    for (int i = 1; i < 4; i++)
        if (four[i] > four[k]) k = i;
    const double wx = r[7] - r[5], wy = r[2] - r[6], wz = r[3] - r[1], xy = r[1] + r[3], xz = r[2] + r[6],
                 yz = r[5] + r[7];
    const double row[4][4] = {
        {four[0], wx, wy, wz}, {wx, four[1], xy, xz}, {wy, xy, four[2], yz}, {wz, xz, yz, four[3]}};
    double norm = 0;
    for (int i = 0; i < 4; i++)
        norm += row[k][i] * row[k][i];
    norm = row[k][0] < 0 ? -sqrt(norm) : sqrt(norm);
    for (int i = 0; i < 4; i++)
        q[i] = row[k][i] / norm;
}

int station_pose_check(const struct station_pose *pose, const char *path, struct sh_err *err)
{
    const double *s = pose->shift_m;
    double q[4];
    station_pose_quaternion(pose, q);
    if (isfinite(s[0]) && isfinite(s[1]) && isfinite(s[2]) && isfinite(q[0] + q[1] + q[2] + q[3])) return SH_OK;
    return sh_fail(
        err, SH_EFORMAT,
        "%s: the stream is broken: a scan's pose is infinite or NaN: position (%g %g %g), quaternion (%g %g %g %g)",
        path, s[0], s[1], s[2], q[0], q[1], q[2], q[3]);
}
