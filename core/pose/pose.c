/* SPDX-License-Identifier: MIT */
/* Attitudes, and poses between two poses. */
#include "core/pose.h"

#include <math.h>
#include <string.h>

#include "core/mat3.h"
#include "core/vec3.h"

void pose_from_angles(double heading_rad, double pitch_rad, double roll_rad, double quat[4])
{
    const double qz[4] = {cos(0.5 * heading_rad), 0.0, 0.0, -sin(0.5 * heading_rad)};
    const double qx[4] = {cos(0.5 * pitch_rad), sin(0.5 * pitch_rad), 0.0, 0.0};
    const double qy[4] = {cos(0.5 * roll_rad), 0.0, sin(0.5 * roll_rad), 0.0};
    quat_multiply(qz, qx, quat);
    quat_multiply(quat, qy, quat);
}

/* R's middle column is (sin h cos p, cos h cos p, sin p). Once R is turned back by the heading, its first row is
 * (cos r, 0, sin r). Near the pole the heading has a large error. The error of roll is then the opposite one, so that
 * both cancel in the attitude. */
static void matrix_to_angles(const double r[9], double *heading_rad, double *pitch_rad, double *roll_rad)
{
    double flat = hypot(r[1], r[4]);
    *pitch_rad = atan2(r[7], flat);
    int pole = flat < 1e-9;
    double heading = pole ? atan2(-r[3], r[0]) : atan2(r[1], r[4]);
    double sh = sin(heading), ch = cos(heading);
    *roll_rad = pole ? 0.0 : atan2(ch * r[2] - sh * r[5], ch * r[0] - sh * r[3]);
    if (heading < 0.0) heading += 2.0 * M_PI;
    *heading_rad = heading < 2.0 * M_PI ? heading : 0.0; /* a heading just below 0 is rounded to a whole turn */
}

void pose_to_angles(const double quat[4], double *heading_rad, double *pitch_rad, double *roll_rad)
{
    double r[9];
    quat_matrix(quat, r);
    matrix_to_angles(r, heading_rad, pitch_rad, roll_rad);
}

void pose_from_matrix(const double rotation[9], double quat[4])
{
    double heading_rad, pitch_rad, roll_rad;
    matrix_to_angles(rotation, &heading_rad, &pitch_rad, &roll_rad);
    pose_from_angles(heading_rad, pitch_rad, roll_rad, quat);
}

void pose_rotate(const double quat[4], const double v[3], double out[3])
{
    double r[9];
    const double from[3] = {v[0], v[1], v[2]};
    quat_matrix(quat, r);
    mat3_apply(r, from, out);
}

double pose_angle_between(const double a[4], const double b[4])
{
    double axis[3], angle;
    quat_turn(a, b, axis, &angle);
    return angle;
}

void pose_between(const struct pose *a, const struct pose *b, double fraction, struct pose *out)
{
    double axis[3], angle;
    quat_turn(a->quat, b->quat, axis, &angle);
    const double half = 0.5 * fraction * angle, s = sin(half);
    const double turn[4] = {cos(half), s * axis[0], s * axis[1], s * axis[2]};
    for (int i = 0; i < 3; i++)
        out->position_m[i] = a->position_m[i] + fraction * (b->position_m[i] - a->position_m[i]);
    quat_multiply(a->quat, turn, out->quat);
}

void pose_mount(const struct pose *body, const struct pose *mount, struct pose *out)
{
    double arm[3];
    pose_rotate(body->quat, mount->position_m, arm);
    vec3_add(body->position_m, arm, out->position_m);
    quat_multiply(body->quat, mount->quat, out->quat);
}

void pose_attitude(double heading_rad, double pitch_rad, double roll_rad, double rotation[9])
{
    double sh = sin(heading_rad), ch = cos(heading_rad), sp = sin(pitch_rad), cp = cos(pitch_rad);
    double sr = sin(roll_rad), cr = cos(roll_rad);
    /* clang-format off */
    const double r[9] = {
        ch * cr + sh * sp * sr,  sh * cp, ch * sr - sh * sp * cr,
        -sh * cr + ch * sp * sr, ch * cp, -sh * sr - ch * sp * cr,
        -cp * sr,                sp,      cp * cr,
    };
    /* clang-format on */
    memcpy(rotation, r, sizeof r);
}

void pose_heading(double heading_rad, double rotation[9])
{
    pose_attitude(heading_rad, 0.0, 0.0, rotation);
    for (int i = 0; i < 9; i++)
        rotation[i] += 0.0; /* no negative zeros */
}

size_t pose_find_knot(const struct pose_knot *knot, size_t n, int64_t t_ns)
{
    size_t at = 0, after = n;
    while (after - at > 1) {
        size_t mid = at + (after - at) / 2;
        if (knot[mid].t_ns <= t_ns)
            at = mid;
        else
            after = mid;
    }
    return at;
}
