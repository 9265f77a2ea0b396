/* SPDX-License-Identifier: MIT */
/* Position and attitude of a platform and of the head on it. In: angles in radians, positions in metres,
 * trajectories from CSV files. Out: attitudes as quaternions or matrices, and the pose at any time.
 *
 * Attitude, the one convention of the project: a rotation R takes the body's frame (x right, y forward, z up)
 * to the scene frame (x east, y north, z up),
 *     R = Rz(-heading) Rx(pitch) Ry(roll).
 * Heading is clockwise from north (the scene's y axis) seen from above. Pitch is positive with the nose up,
 * roll with the right side down. Quaternions are (w, x, y, z), of length one; q and -q are the same attitude:
 *     q = qz(-heading) qx(pitch) qy(roll), products by Hamilton's rule.
 *
 * Between two poses the position goes along the straight line, and the attitude turns the shorter way about
 * one fixed axis at constant rate (slerp, Shoemake 1985): pose_between. The head moves like this between the
 * poses it sends.
 *
 * A trajectory has samples further apart. Between two samples the position is a cubic Hermite curve. The curve's
 * velocity at a sample is the derivative of the parabola through the sample and its two neighbours, or zero where the
 * platform stands before or after it. The attitude is slerp. On a circle of 10 m at 10 m/s sampled at 10 Hz
 * the error of the position is 0.16 mm; straight lines would have 12.5 mm (tests/unit/test_pose.c). Before the
 * first and after the last sample the platform stands.
 *
 * Pure, except for reading the files. Trajectories are constant after creation, any thread. */
#ifndef CORE_POSE_H
#define CORE_POSE_H

#include <stddef.h>
#include <stdint.h>

#include "core/err.h"
#include "core/geoframe.h"
#include "core/quat.h"

struct pose {
    double position_m[3]; /* of the body's origin, prcs */
    double quat[4];       /* body -> prcs */
};

/* A pose and its time, as casting takes both and as both go out on the wire. */
struct pose_knot {
    int64_t t_ns; /* since the scan's start */
    struct pose pose;
    double frame;   /* frame scalar of the trajectory */
    uint32_t flags; /* enum pose_flags */
};

enum pose_flags {
    POSE_EXTRAPOLATED = 1u << 0, /* after the last live pose that had arrived */
    POSE_LATE = 1u << 1,         /* too long after it: the platform is taken to stand */
    POSE_NONE = 1u << 2,         /* no live pose of this time or before had arrived: this is the station's */
};

void pose_from_angles(double heading_rad, double pitch_rad, double roll_rad, double quat[4]);
/* Heading lies in [0, 2 pi), pitch in [-pi/2, pi/2], roll in (-pi, pi]. Roll is 0 where pitch is +-pi/2. */
void pose_to_angles(const double quat[4], double *heading_rad, double *pitch_rad, double *roll_rad);
void pose_from_matrix(const double rotation[9], double quat[4]);
/* R of a head turned by heading, then pitch, then roll, each about the axes as they lie by then; row by row:
 *
 *      ch cr + sh sp sr    sh cp    ch sr - sh sp cr
 *     -sh cr + ch sp sr    ch cp   -sh sr - ch sp cr
 *     -cp sr               sp       cp cr              */
void pose_attitude(double heading_rad, double pitch_rad, double roll_rad, double rotation[9]);
/* The same for a levelled head. */
void pose_heading(double heading_rad, double rotation[9]);
void pose_rotate(const double quat[4], const double v[3], double out[3]);
/* Angle between two attitudes, in [0, pi]. */
double pose_angle_between(const double a[4], const double b[4]);
void pose_between(const struct pose *a, const struct pose *b, double fraction, struct pose *out);
/* The pose of a head that is mounted on a body: mount is the head's pose in the body's frame. */
void pose_mount(const struct pose *body, const struct pose *mount, struct pose *out);

/* Returns the index of the last knot at or before t_ns; 0 where t_ns is before the first knot. The n >= 1 knots are in
 * order of time. */
size_t pose_find_knot(const struct pose_knot *knot, size_t n, int64_t t_ns);

/* Files of millions of samples take seconds. Functions with a report end with SH_ESTOPPED where it asks to
 * stop. */
struct trajectory;

struct pose_sample {
    double t_s;
    struct pose pose; /* quat of any length above 1e-6 */
    double frame;
};

enum {
    POSE_MIN_STEP_US = 100,   /* samples are at least this far apart */
    POSE_MAX_KNOTS = 10000000 /* of a trajectory: 800 MB of memory, 28 hours every 10 ms */
};

/* n >= 1 samples, times rising by POSE_MIN_STEP_US at least; copied. SH_EINPUT says which sample is wrong. */
int trajectory_from_samples(const struct pose_sample *sample, size_t n, struct trajectory **out, struct sh_err *err);

/* A CSV file whose first line names the columns, in any order: t_s, x_m, y_m, z_m, and either heading_deg,
 * pitch_deg, roll_deg (heading alone will do) or qw, qx, qy, qz; frame where wanted (else the sample's
 * number, from 0); the columns scan and flags of `scanhead record -o NAME.poses.csv` are ignored, and so is a
 * byte order mark of UTF-8. Lines that begin with '#' and empty lines don't count. Times are within 4e9 s of
 * 0, so that nanoseconds between any two fit into 64 bits. Everything else is an error with file and line. */
int trajectory_read_csv(const char *path, const struct sh_report *report, struct trajectory **out, struct sh_err *err);

/* Reads way-points from a CSV file: x_m, y_m, z_m, speed_m_s, and pause_s where wanted. The platform goes
 * through them on the cubic Hermite curve described above. The way to the next point takes chord / speed_m_s;
 * the last point needs a speed, which is not used. At a point with pause_s the platform comes to rest smoothly, stands
 * for that time and starts smoothly. The platform heads along the path, with pitch and roll 0. These angles count from
 * the axes that a station has there: geoframe_level of frame, or the scene's own where frame is NULL. Samples are at
 * most 0.02 s apart, or 0.01 m of the way where that takes longer. A way shorter than 0.64 m has up to 64 samples, even
 * if they are less than 0.01 m apart. A pause has none within it. SH_EINPUT also for more than POSE_MAX_KNOTS. */
int trajectory_read_waypoints(const char *path, const struct geoframe *frame, const struct sh_report *report,
                              struct trajectory **out, struct sh_err *err);

void trajectory_free(struct trajectory *trajectory);
void trajectory_span(const struct trajectory *trajectory, double *first_s, double *last_s);
void trajectory_at(const struct trajectory *trajectory, double t_s, struct pose *pose, double *frame);

/* Rules for the knots of a path. */
struct pose_knot_rules {
    double start_s, end_s; /* on the trajectory */
    double tolerance_m;    /* between two knots pose_between may differ from the trajectory by this */
    /* Where the head moves further than longest_m between two knots, or turns by over 0.01 rad, the knots are at most
     * longest_ns apart. */
    int64_t longest_ns;
    double longest_m;
};

struct pose_path {
    struct pose_knot *knot; /* the first one at time 0 */
    size_t n;
    /* Bound of the largest distance from the trajectory: (acceleration + turning rate^2 * lever arm) * step^2 / 8. */
    double error_m;
};

/* The path of a head that is mounted on the platform, from start_s (time 0 of the knots) to end_s or the
 * trajectory's end, whichever comes first. There is a knot at each sample, and between two samples as many as
 * the rules ask for; error_m is more than tolerance_m only where POSE_MIN_STEP_US is the limit. The caller
 * frees out->knot, after an error as well. SH_EINPUT for more than POSE_MAX_KNOTS. */
int trajectory_knots(const struct trajectory *trajectory, const struct pose *mount, const struct pose_knot_rules *rules,
                     const struct sh_report *report, struct pose_path *out, struct sh_err *err);

#endif
