/* SPDX-License-Identifier: MIT */
/* Pulses of a moving head are turned and placed by the pose of their own time, as pose_between has it. */
#include "core/cast/kernels_moving.h"

#include "core/mat3.h"
#include "core/vecmath.h"

void kernel_leg(const struct pose_knot *a, const struct pose_knot *b, int64_t t0_ns, struct kernel_leg *leg)
{
    double angle_rad;
    leg->before_ns = (double)(t0_ns - a->t_ns);
    leg->span_ns = b->t_ns > a->t_ns ? (double)(b->t_ns - a->t_ns) : 1.0;
    for (int i = 0; i < 3; i++) {
        leg->position_m[i] = a->pose.position_m[i];
        leg->shift_m[i] = b->pose.position_m[i] - a->pose.position_m[i];
    }
    quat_matrix(a->pose.quat, leg->rotation);
    quat_turn(a->pose.quat, b->pose.quat, leg->axis, &angle_rad);
    leg->turn = angle_rad / VEC_TURN_RAD;
}

/* Rodrigues' formula about the axis, then the first pose's rotation. */
VEC_CLONES
void kernel_turn_leg(const struct kernel_leg *leg, const uint32_t *restrict dt_ns, uint32_t n,
                     const struct vec3_in *from, const struct vec3_out *to)
{
    const double *m = leg->rotation;
    const double m0 = m[0], m1 = m[1], m2 = m[2], m3 = m[3], m4 = m[4], m5 = m[5], m6 = m[6], m7 = m[7], m8 = m[8];
    const double ax = leg->axis[0], ay = leg->axis[1], az = leg->axis[2], turn = leg->turn;
    const double before = leg->before_ns, span = leg->span_ns;
    const struct vec3_in s = *from;
    const struct vec3_out d = *to;
    if (turn == 0.0) { /* no rotation between the two poses: the formula would add zeros */
        double back[9];
        mat3_transpose(m, back);
        kernel_turn_back(from, back, n, to);
        return;
    }
    VEC_LOOP
    for (uint32_t i = 0; i < n; i++) {
        double sine, c, sx = s.x[i], sy = s.y[i], sz = s.z[i];
        vec_sincos_turn((before + (double)(int32_t)dt_ns[i]) / span * turn, &sine, &c);
        double ux = ay * sz - az * sy, uy = az * sx - ax * sz, uz = ax * sy - ay * sx;
        double wx = ay * uz - az * uy, wy = az * ux - ax * uz, wz = ax * uy - ay * ux, v = 1.0 - c;
        double x = sx + sine * ux + v * wx, y = sy + sine * uy + v * wy, z = sz + sine * uz + v * wz;
        d.x[i] = m0 * x + m1 * y + m2 * z;
        d.y[i] = m3 * x + m4 * y + m5 * z;
        d.z[i] = m6 * x + m7 * y + m8 * z;
    }
}

VEC_CLONES
void kernel_place_leg(const struct kernel_leg *leg, const uint32_t *restrict dt_ns, uint32_t n,
                      const struct vec3_out *to)
{
    const double x = leg->position_m[0], y = leg->position_m[1], z = leg->position_m[2];
    const double vx = leg->shift_m[0], vy = leg->shift_m[1], vz = leg->shift_m[2];
    const double before = leg->before_ns, span = leg->span_ns;
    const struct vec3_out p = *to;
    VEC_LOOP
    for (uint32_t i = 0; i < n; i++) {
        double f = (before + (double)(int32_t)dt_ns[i]) / span;
        p.x[i] = x + f * vx;
        p.y[i] = y + f * vy;
        p.z[i] = z + f * vz;
    }
}

VEC_CLONES
void kernel_shift(const struct vec3_in *from, const double by[3], uint32_t n, const struct vec3_out *to)
{
    const double x = by[0], y = by[1], z = by[2];
    const struct vec3_in p = *from;
    const struct vec3_out o = *to;
    VEC_LOOP
    for (uint32_t i = 0; i < n; i++) {
        o.x[i] = p.x[i] + x;
        o.y[i] = p.y[i] + y;
        o.z[i] = p.z[i] + z;
    }
}

VEC_CLONES
void kernel_scale_from(const double *restrict range_m, const struct vec3_in *origin, const double station_m[3],
                       uint32_t n, const struct vec3_out *position)
{
    const double x = station_m[0], y = station_m[1], z = station_m[2];
    const struct vec3_in p = *origin;
    const struct vec3_out e = *position;
    VEC_LOOP
    for (uint32_t i = 0; i < n; i++) {
        e.x[i] = e.x[i] * range_m[i] + (p.x[i] - x);
        e.y[i] = e.y[i] * range_m[i] + (p.y[i] - y);
        e.z[i] = e.z[i] * range_m[i] + (p.z[i] - z);
    }
}

VEC_CLONES
int kernel_meets_sphere(const struct vec3_in *dir, uint32_t n, const double v[3], double radius_m)
{
    const double x = v[0], y = v[1], z = v[2], v2 = x * x + y * y + z * z, r2 = radius_m * radius_m;
    const struct vec3_in d = *dir;
    uint64_t meets = v2 <= r2;
    for (uint32_t i = 0; i < n; i++) {
        double along = x * d.x[i] + y * d.y[i] + z * d.z[i];
        uint64_t near = v2 - along * along <= r2, ahead = along > 0.0;
        meets |= near & ahead;
    }
    return meets != 0;
}

VEC_CLONES
void kernel_turn_back(const struct vec3_in *from, const double m[9], uint32_t n, const struct vec3_out *to)
{
    const double m0 = m[0], m1 = m[1], m2 = m[2], m3 = m[3], m4 = m[4], m5 = m[5], m6 = m[6], m7 = m[7], m8 = m[8];
    const struct vec3_in d = *from;
    const struct vec3_out e = *to;
    VEC_LOOP
    for (uint32_t i = 0; i < n; i++) {
        double x = d.x[i], y = d.y[i], z = d.z[i];
        e.x[i] = m0 * x + m3 * y + m6 * z;
        e.y[i] = m1 * x + m4 * y + m7 * z;
        e.z[i] = m2 * x + m5 * y + m8 * z;
    }
}
