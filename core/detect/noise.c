/* SPDX-License-Identifier: MIT */
#include <math.h>

#include "core/detect.h"
#include "core/light.h"
#include "core/mat3.h"
#include "core/rng.h"
#include "core/vecmath.h"

VEC_CLONES
void detect_range_noise(const struct detect_signal *signal, const struct detect_echoes *echoes)
{
    const double floor2 = signal->floor2, jitter2 = signal->jitter2, per_distance = signal->per_distance;
    const uint64_t range_key = signal->range_key ^ echoes->scan_key, *restrict key = echoes->key;
    const double *restrict amplitude = echoes->amplitude;
    double *restrict range_m = echoes->range_m;
    const uint32_t n = echoes->n;
    uint64_t bits[RNG_BLOCK];
    for (uint32_t at = 0, m; at < n; at += m) {
        const double *restrict a = amplitude + at;
        double *restrict r = range_m + at;
        m = rng_bits(range_key, key + at, n - at, bits);
        for (uint32_t i = 0; i < m; i++) {
            const double least = a[i] > DETECT_LEAST_AMPLITUDE ? a[i] : DETECT_LEAST_AMPLITUDE;
            r[i] += (sqrt(floor2 + jitter2 / (least * least)) + per_distance * r[i]) * rng_normal_of(bits[i]);
        }
    }
}

VEC_CLONES
void detect_fixed_noise(double sigma0_m, double sigma1, uint64_t range_key, uint32_t n, const uint64_t *restrict key,
                        double *restrict range_m)
{
    uint64_t bits[RNG_BLOCK];
    for (uint32_t at = 0, m; at < n; at += m) {
        double *restrict r = range_m + at;
        m = rng_bits(range_key, key + at, n - at, bits);
        for (uint32_t i = 0; i < m; i++)
            r[i] += (sigma0_m + sigma1 * r[i]) * rng_normal_of(bits[i]);
    }
}

VEC_CLONES
void detect_zones(enum detect_ambiguity how, double period_s, uint32_t zones, double range_min_m, uint32_t n,
                  double *restrict range_m)
{
    const double zone_m = 0.5 * LIGHT_SPEED_M_S * period_s, per_m = 1.0 / zone_m;
    const double most_m = how == DETECT_RESOLVED ? zone_m * (double)zones : (double)INFINITY;
    for (uint32_t i = 0; i < n; i++) {
        double zone = floor(range_m[i] * per_m), within = range_m[i] - zone * zone_m;
        int blind = within < range_min_m || range_m[i] >= most_m;
        double reported = how == DETECT_FOLDED ? within : range_m[i];
        range_m[i] = how == DETECT_AMBIGUITY_NONE ? range_m[i] : blind ? (double)NAN : reported;
    }
}

void detect_ball_keys(struct detect_ball *ball, uint64_t seed)
{
    ball->direction_key = rng_key(seed, RNG_BALL);
    ball->radius_key = rng_key(seed, RNG_BALL_RADIUS);
}

/* Draws a place uniformly in the unit ball: a height uniform in -1..1 and an angle give a direction (Archimedes),
 * the cube root of a uniform number the distance. */
static void in_unit_ball(const struct detect_ball *ball, uint64_t scan_key, uint64_t key, double u[3])
{
    uint64_t bits = rng_u64(ball->direction_key ^ scan_key, key);
    double z = ((double)(bits >> 32) + 0.5) * 0x1p-31 - 1.0, s, c;
    double r = cbrt(((double)(rng_u64(ball->radius_key ^ scan_key, key) >> 11) + 0.5) * 0x1p-53),
           across = r * sqrt(1.0 - z * z);
    vec_sincos_turn((double)(bits & 0xffffffffU) * 0x1p-32, &s, &c);
    u[0] = across * c;
    u[1] = across * s;
    u[2] = r * z;
}

/* The point lies in the plane of the line angle, at `ahead` and `up`, and is moved by v: to the right, ahead
 * (along the head's horizon), up. A line angle that looks backward over the zenith still does so
 * afterwards. */
static void move_point(const double v[3], double *range_m, double *mirror_turn, double *pan_turn)
{
    double s, c;
    vec_sincos_turn(*mirror_turn, &s, &c);
    double face = c < 0.0 ? -1.0 : 1.0;
    double right = v[0], ahead = *range_m * c + v[1], up = *range_m * s + v[2], flat = hypot(right, ahead);
    double turned = atan2(face * right, face * ahead), tilt = atan2(up, face * flat);
    double before = atan2(s, c), by = tilt - before;
    by -= VEC_TURN_RAD * floor(by / VEC_TURN_RAD + 0.5);
    *range_m = sqrt(flat * flat + up * up);
    *pan_turn += turned / VEC_TURN_RAD;
    *mirror_turn += by / VEC_TURN_RAD;
}

void detect_move_in_ball(const struct detect_ball *ball, const double m[9], const struct detect_points *p)
{
    for (uint32_t i = 0; i < p->n; i++) {
        if (isnan(p->range_m[i])) continue;
        double u[3], v[3], s, c;
        double radius_m = ball->radius_m * (1.0 + ball->per_distance_1_m * p->range_m[i]);
        in_unit_ball(ball, p->scan_key, p->key[i], u);
        for (int k = 0; k < 3; k++)
            u[k] *= radius_m * ball->factor[k];
        if (ball->local) { /* along, right, up */
            vec_sincos_turn(p->mirror_turn[i], &s, &c);
            v[0] = u[1];
            v[1] = c * u[0] - s * u[2];
            v[2] = s * u[0] + c * u[2];
        } else {
            double w[3];
            mat3_apply_transposed(m, u, w);
            vec_sincos_turn(p->pan_turn[i], &s, &c);
            v[0] = c * w[0] - s * w[1]; /* the pan counts clockwise: ahead is (sin, cos), right (cos, -sin) */
            v[1] = s * w[0] + c * w[1];
            v[2] = w[2];
        }
        move_point(v, &p->range_m[i], &p->mirror_turn[i], &p->pan_turn[i]);
    }
}
