/* Pulses of a moving head: each turned and placed by the pose of its own time, as pose_between has it. */
#include <math.h>

#include "core/cast/kernels.h"
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
    pose_matrix(a->pose.quat, leg->rotation);
    pose_turn(a->pose.quat, b->pose.quat, leg->axis, &angle_rad);
    leg->turn = angle_rad / VEC_TURN_RAD;
}

/* Rodrigues' formula about the axis, then the first pose's rotation. */
VEC_CLONES
void kernel_turn_leg(const struct kernel_leg *leg, const uint32_t *restrict dt_ns, uint32_t n,
                     const double *restrict sx, const double *restrict sy, const double *restrict sz,
                     double *restrict dx, double *restrict dy, double *restrict dz)
{
    const double *m = leg->rotation;
    const double m0 = m[0], m1 = m[1], m2 = m[2], m3 = m[3], m4 = m[4], m5 = m[5], m6 = m[6], m7 = m[7], m8 = m[8];
    const double ax = leg->axis[0], ay = leg->axis[1], az = leg->axis[2], turn = leg->turn;
    const double before = leg->before_ns, span = leg->span_ns;
    for (uint32_t i = 0; i < n; i++) {
        double s, c;
        vec_sincos_turn((before + (double)(int32_t)dt_ns[i]) / span * turn, &s, &c);
        double ux = ay * sz[i] - az * sy[i], uy = az * sx[i] - ax * sz[i], uz = ax * sy[i] - ay * sx[i];
        double wx = ay * uz - az * uy, wy = az * ux - ax * uz, wz = ax * uy - ay * ux, v = 1.0 - c;
        double x = sx[i] + s * ux + v * wx, y = sy[i] + s * uy + v * wy, z = sz[i] + s * uz + v * wz;
        dx[i] = m0 * x + m1 * y + m2 * z;
        dy[i] = m3 * x + m4 * y + m5 * z;
        dz[i] = m6 * x + m7 * y + m8 * z;
    }
}

VEC_CLONES
void kernel_place_leg(const struct kernel_leg *leg, const uint32_t *restrict dt_ns, uint32_t n, double *restrict px,
                      double *restrict py, double *restrict pz)
{
    const double x = leg->position_m[0], y = leg->position_m[1], z = leg->position_m[2];
    const double vx = leg->shift_m[0], vy = leg->shift_m[1], vz = leg->shift_m[2];
    const double before = leg->before_ns, span = leg->span_ns;
    for (uint32_t i = 0; i < n; i++) {
        double f = (before + (double)(int32_t)dt_ns[i]) / span;
        px[i] = x + f * vx;
        py[i] = y + f * vy;
        pz[i] = z + f * vz;
    }
}

VEC_CLONES
void kernel_subtract(const double *restrict px, const double *restrict py, const double *restrict pz,
                     const double from[3], uint32_t n, double *restrict ox, double *restrict oy, double *restrict oz)
{
    const double x = from[0], y = from[1], z = from[2];
    for (uint32_t i = 0; i < n; i++) {
        ox[i] = px[i] - x;
        oy[i] = py[i] - y;
        oz[i] = pz[i] - z;
    }
}

VEC_CLONES
void kernel_scale_from(const double *restrict range_m, const double *restrict px, const double *restrict py,
                       const double *restrict pz, const double station_m[3], uint32_t n, double *restrict ex,
                       double *restrict ey, double *restrict ez)
{
    const double x = station_m[0], y = station_m[1], z = station_m[2];
    for (uint32_t i = 0; i < n; i++) {
        ex[i] = ex[i] * range_m[i] + (px[i] - x);
        ey[i] = ey[i] * range_m[i] + (py[i] - y);
        ez[i] = ez[i] * range_m[i] + (pz[i] - z);
    }
}
