/* Where the head stands in the frame that a recording's points are in: the stream's CRS (geo layout) or the scene
 * frame (polar layout).
 *
 * Recorders whose formats keep points in the scanner's frame beside a pose (PTX, E57) write points and pose so that the
 * pose takes each point to its place in the CRS, whatever the CRS: in the geo layout the points are taken back by the
 * very pose that is written. In a local frame and in ECEF what comes out is the head's own frame; in UTM and UPS it is
 * that frame with the grid's scale and bending in it, since a rigid pose can't hold them.
 * Pure; any thread. */
#ifndef DRIVERS_HOST_POSE_H
#define DRIVERS_HOST_POSE_H

#include "drivers/host/scanhead.h"

struct pose {
    double shift_m[3];  /* the head in the recording's frame */
    double rotation[9]; /* head's frame (SOCS) -> recording's frame, row by row; proper */
};

/* In UTM and UPS the rotation holds the meridian convergence: tan g = tan(lon - lon0) sin(lat), which is exact on the
 * sphere and on the ellipsoid good to 1e-6 rad within a zone (the terms left out begin with e'^2 dlon^3 / 3). */
void pose_of(const struct scanhead_info *info, struct pose *pose);

/* p = shift + rotation * p, and back. */
void pose_forward(const struct pose *pose, double p[3]);
void pose_reverse(const struct pose *pose, double p[3]);

/* The unit quaternion w, x, y, z of the rotation; w is not negative. */
void pose_quaternion(const struct pose *pose, double q[4]);

#endif
