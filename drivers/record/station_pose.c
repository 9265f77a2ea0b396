#include "drivers/record/station_pose.h"

#include <math.h>
#include <string.h>

void station_pose_of(const struct scanhead_info *info, struct station_pose *pose)
{
    const double *m = info->axes, *r = info->rotation;
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            pose->rotation[3 * i + j] =
                info->geo ? m[3 * i] * r[j] + m[3 * i + 1] * r[3 + j] + m[3 * i + 2] * r[6 + j] : r[3 * i + j];
    memcpy(pose->shift_m, info->geo ? info->anchor : info->station_m, sizeof pose->shift_m);
}

void station_pose_forward(const struct station_pose *pose, double p[3])
{
    const double *r = pose->rotation, *s = pose->shift_m;
    double x = p[0], y = p[1], z = p[2];
    p[0] = s[0] + (r[0] * x + r[1] * y + r[2] * z);
    p[1] = s[1] + (r[3] * x + r[4] * y + r[5] * z);
    p[2] = s[2] + (r[6] * x + r[7] * y + r[8] * z);
}

void station_pose_reverse(const struct station_pose *pose, double p[3])
{
    const double *r = pose->rotation, *s = pose->shift_m;
    double x = p[0] - s[0], y = p[1] - s[1], z = p[2] - s[2];
    p[0] = r[0] * x + r[3] * y + r[6] * z;
    p[1] = r[1] * x + r[4] * y + r[7] * z;
    p[2] = r[2] * x + r[5] * y + r[8] * z;
}

/* By the largest of the four components, so that none is the difference of near numbers (Shepperd 1978). */
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
