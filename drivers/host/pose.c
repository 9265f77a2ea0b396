#include "drivers/host/pose.h"

#include <math.h>
#include <string.h>

#include "drivers/protocol/native.h"

enum { EPSG_UPS_NORTH = 32661, EPSG_UPS_SOUTH = 32761 };

#define RAD (3.14159265358979323846 / 180.0)

static double convergence_rad(const struct scanhead_info *info)
{
    double lat = RAD * info->lat_deg;
    if (info->epsg == EPSG_UPS_NORTH) return RAD * info->lon_deg;
    if (info->epsg == EPSG_UPS_SOUTH) return -RAD * info->lon_deg;
    double dlon = RAD * remainder(info->lon_deg - (6.0 * (info->epsg % 100) - 183.0), 360.0);
    return atan2(sin(lat) * sin(dlon), cos(dlon));
}

/* East, north, up at the station -> axes of the CRS. */
static void axes_of(const struct scanhead_info *info, double m[9])
{
    static const double same[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1};
    memcpy(m, same, sizeof same);
    if (!info->geo) return;
    if (info->crs == NATIVE_CRS_ECEF) {
        double sp = sin(RAD * info->lat_deg), cp = cos(RAD * info->lat_deg), sl = sin(RAD * info->lon_deg),
               cl = cos(RAD * info->lon_deg);
        const double ecef[9] = {-sl, -sp * cl, cp * cl, cl, -sp * sl, cp * sl, 0, cp, sp};
        memcpy(m, ecef, sizeof ecef);
    } else if (info->crs == NATIVE_CRS_UTM) {
        double g = convergence_rad(info);
        m[0] = m[4] = cos(g);
        m[3] = sin(g);
        m[1] = -m[3];
    }
}

void pose_of(const struct scanhead_info *info, struct pose *pose)
{
    double m[9];
    axes_of(info, m);
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            pose->rotation[3 * i + j] = m[3 * i] * info->rotation[j] + m[3 * i + 1] * info->rotation[3 + j] +
                                        m[3 * i + 2] * info->rotation[6 + j];
    memcpy(pose->shift_m, info->geo ? info->anchor : info->station_m, sizeof pose->shift_m);
}

void pose_forward(const struct pose *pose, double p[3])
{
    const double *r = pose->rotation, *s = pose->shift_m;
    double x = p[0], y = p[1], z = p[2];
    p[0] = s[0] + (r[0] * x + r[1] * y + r[2] * z);
    p[1] = s[1] + (r[3] * x + r[4] * y + r[5] * z);
    p[2] = s[2] + (r[6] * x + r[7] * y + r[8] * z);
}

void pose_reverse(const struct pose *pose, double p[3])
{
    const double *r = pose->rotation, *s = pose->shift_m;
    double x = p[0] - s[0], y = p[1] - s[1], z = p[2] - s[2];
    p[0] = r[0] * x + r[3] * y + r[6] * z;
    p[1] = r[1] * x + r[4] * y + r[7] * z;
    p[2] = r[2] * x + r[5] * y + r[8] * z;
}

/* By the largest of the four components, so that none is the difference of near numbers (Shepperd 1978). */
void pose_quaternion(const struct pose *pose, double q[4])
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
