/* SPDX-License-Identifier: MIT */
/* The head's pose in the frame that a recording's points are in: the stream's CRS (geo layout) or the scene frame
 * (polar layout).
 *
 * Some formats keep points in the scanner's frame beside a pose (PTX, E57). Recorders of these formats write points and
 * pose so that the pose takes each point to its place in the CRS. In the geo layout the stream has points in the CRS,
 * so these recorders apply the inverse of the pose to them. In local coordinates and in ECEF the result is in the
 * head's own frame. In UTM and UPS the result also holds the grid's scale and curvature, since a rigid pose can't hold
 * them. Pure; any thread. */
#ifndef DRIVERS_RECORD_STATION_POSE_H
#define DRIVERS_RECORD_STATION_POSE_H

#include "core/mat3.h"
#include "core/err.h"
#include "drivers/host/scanhead.h"

struct station_pose {
    double shift_m[3];  /* the head in the recording's frame */
    double rotation[9]; /* head's frame (SOCS) -> recording's frame, row by row; proper */
};

/* Shift and rotation are the anchor's. Where the head moves, they don't say where the head is: see track.h. In
 * geodetic coordinates the shift is degrees, degrees, metres, and the axes are east, north, up. */
void station_pose_of(const struct scanhead_info *info, struct station_pose *pose);

#define EARTH_RADIUS_M 6371000.0 /* of a sphere, which is accurate enough for angles and colours */
/* Converts latitude and longitude to metres east and north of a pose in geodetic coordinates. */
void station_pose_level(const struct station_pose *pose, double lat_deg, double lon_deg, double east_north_m[2]);

/* p = shift + rotation * p, and back. */
static inline void station_pose_forward(const struct station_pose *pose, double p[3])
{
    double turned[3];
    mat3_apply(pose->rotation, p, turned);
    for (int i = 0; i < 3; i++)
        p[i] = pose->shift_m[i] + turned[i];
}
static inline void station_pose_reverse(const struct station_pose *pose, double p[3])
{
    const double *s = pose->shift_m, from_station[3] = {p[0] - s[0], p[1] - s[1], p[2] - s[2]};
    mat3_apply_transposed(pose->rotation, from_station, p);
}
/* station_pose_reverse_all and station_pose_forward_all do the same for n points in columns; the results are equal bit
 * for bit. */
void station_pose_reverse_all(const struct station_pose *restrict pose, int n, double *restrict x, double *restrict y,
                              double *restrict z);
void station_pose_forward_all(const struct station_pose *restrict pose, int n, double *restrict x, double *restrict y,
                              double *restrict z);

/* Writes the unit quaternion w, x, y, z of the rotation; w is not negative. */
void station_pose_quaternion(const struct station_pose *pose, double q[4]);

/* SH_EFORMAT, with path in its text, where the stream is broken: the shift or the quaternion is infinite or NaN. For
 * formats that hold poses. */
int station_pose_check(const struct station_pose *pose, const char *path, struct sh_err *err);

#endif
