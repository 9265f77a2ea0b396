/* SPDX-License-Identifier: MIT */
/* Figures of a beam, and patterns of sub-rays. */
#include "core/footprint.h"

#include <math.h>
#include <string.h>

#include "core/light.h"
#include "core/vec3.h"
#include "core/vecmath.h"

/* t = rho^2 over the footprint has a density proportional to exp(-2 t) on 0 .. 1. The means of t, t^2 and t^3 follow by
 * integration by parts. */
static double mean_t(void)
{
    return 0.5 - exp(-2.0) / (1.0 - exp(-2.0));
}

static double mean_t2(void)
{
    return mean_t() - exp(-2.0) / (1.0 - exp(-2.0));
}

/* A strip of the disc between two distances from the centre. For a chord at one distance the members are per unit of
 * distance. The irradiance is a Gaussian that is cut off at the disc's edge. */
struct strip {
    double energy, along, across; /* energy; its second moments, by the distance and along the chord */
};

static struct strip chord_at(double x)
{
    const double scale = 2.0 / (M_PI * (1.0 - exp(-2.0)));
    double y2 = 1.0 - x * x, g = scale * exp(-2.0 * x * x), whole;
    if (y2 <= 0.0) return (struct strip){0.0, 0.0, 0.0};
    whole = g * sqrt(0.5 * M_PI) * erf(sqrt(2.0 * y2));
    return (struct strip){whole, whole * x * x, 0.25 * whole - 0.5 * g * sqrt(y2) * exp(-2.0 * y2)};
}

/* Sums a strip by Simpson's rule. With x = -cos a the integrand is smooth at the disc's edge as well. */
static struct strip between(double from, double to)
{
    enum { STEPS = 8 };
    double a = acos(-fmax(-1.0, from)), b = acos(-fmin(1.0, to)), step = (b - a) / STEPS;
    struct strip sum = {0.0, 0.0, 0.0};
    for (int i = 0; i <= STEPS; i++) {
        double at = a + i * step, weight = i == 0 || i == STEPS ? 1.0 : i % 2 == 1 ? 4.0 : 2.0;
        struct strip here = chord_at(-cos(at));
        sum.energy += weight * here.energy * sin(at);
        sum.along += weight * here.along * sin(at);
        sum.across += weight * here.across * sin(at);
    }
    return (struct strip){sum.energy * step / 3.0, sum.along * step / 3.0, sum.across * step / 3.0};
}

/* Returns the first moment of the energy beyond the chord at h. It follows by Gauss's theorem, since x exp(-2 r^2) is
 * minus a quarter of the derivative of exp(-2 r^2) by x. */
static double moment_beyond(double h)
{
    const double scale = 2.0 / (M_PI * (1.0 - exp(-2.0)));
    return 0.25 * (chord_at(h).energy - scale * exp(-2.0) * 2.0 * sqrt(fmax(0.0, 1.0 - h * h)));
}

double beam_widening(enum beam_definition definition)
{
    switch (definition) {
    case BEAM_AT_1_E:
        return M_SQRT2;
    case BEAM_AT_HALF_MAXIMUM:
        return sqrt(2.0 / M_LN2);
    case BEAM_HALF_AT_1_E2:
        return 2.0;
    case BEAM_AT_1_E2:
        break;
    }
    return 1.0;
}

void beam_init(struct beam *beam, double exit_m, double divergence_rad, double pulse_width_s)
{
    memset(beam, 0, sizeof *beam);
    beam->exit_radius_m = 0.5 * exit_m;
    beam->slope = 0.5 * divergence_rad;
    beam->resolution_m = 0.5 * LIGHT_SPEED_M_S * pulse_width_s;
    for (int i = BEAM_HALF_STEPS - 1; i >= 0; i--) {
        double h = 2.0 * i / BEAM_HALF_STEPS - 1.0;
        struct strip strip = between(h, h + 2.0 / BEAM_HALF_STEPS);
        beam->half[i] = beam->half[i + 1] + strip.energy;
        beam->along[i] = beam->along[i + 1] + strip.along;
        beam->across[i] = beam->across[i + 1] + strip.across;
    }
    for (int i = 0; i <= BEAM_HALF_STEPS; i++)
        beam->moment[i] = moment_beyond(2.0 * i / BEAM_HALF_STEPS - 1.0);
    for (int i = 0; i <= BEAM_HALF_STEPS; i++)
        beam->half[i] /= beam->half[0] > 0.0 && i > 0 ? beam->half[0] : 1.0;
    beam->half[0] = 1.0;
}

double beam_radius(const struct beam *beam, double range_m)
{
    double spread = beam->slope * range_m;
    return sqrt(beam->exit_radius_m * beam->exit_radius_m + spread * spread);
}

static double mean_t3(void)
{
    return 1.5 * mean_t2() - exp(-2.0) / (1.0 - exp(-2.0));
}

VEC_CLONES
static void plane_means(const double *restrict term, float most, const float *restrict steep, uint32_t n,
                        double *restrict range_m)
{
    for (uint32_t i = 0; i < n; i++) {
        double x = (double)(steep[i] < most ? steep[i] : most);
        range_m[i] += range_m[i] * x * (term[0] + x * (term[1] + x * term[2]));
    }
}

/* The mean range of the sub-rays at one rho is longer than the range at the centre by a share of
 * sqrt((1 + t s^2) / (1 - t b^2)) - 1, where b = s tan i (core/footprint.h). This function takes the share's series to
 * third order in t. With x = 1 / cos^2 i, s^2 + b^2 is s^2 x. Terms below a kept one by a factor of s^2 are left
 * out. */
void beam_plane_means(const struct beam *beam, const float *steep, uint32_t n, double *range_m)
{
    double s2 = beam->slope * beam->slope;
    const double term[3] = {0.5 * s2 * mean_t(), 0.375 * s2 * s2 * mean_t2(), 0.3125 * s2 * s2 * s2 * mean_t3()};
    if (s2 == 0.0) return;
    plane_means(term, (float)(0.25 / s2), steep, n, range_m);
}

/* To first order in s tan i, the variance of the ranges is the variance of rho cos phi times w(R)^2 tan^2 i. The
 * variance of rho cos phi is half the mean t. `steep` counts up to `most`: there the plane is along the beam. */
VEC_CLONES
void beam_plane_widths(const struct beam *beam, const float *restrict steep, const double *restrict range_m, uint32_t n,
                       float *restrict width_m)
{
    const double full = 8.0 * M_LN2, half_t = 0.5 * mean_t(), exit_m = beam->exit_radius_m, slope = beam->slope;
    const float most = 1e12f, pulse2 = (float)(beam->resolution_m * beam->resolution_m);
    const float fixed = (float)(full * (half_t * exit_m * exit_m));
    const float per_range2 = (float)(full * (half_t * slope * slope));
    for (uint32_t i = 0; i < n; i++) {
        float x = (steep[i] < most ? steep[i] : most) - 1.0f, r = (float)range_m[i];
        x = x > 0.0f ? x : 0.0f;
        width_m[i] = sqrtf(pulse2 + (fixed + per_range2 * r * r) * x);
    }
}

/* The sub-ray at (x, y) begins at exit_radius (x e1 + y e2), with slope (x e2 - y e1). by_x and by_y are how its range
 * changes with x and y, to first order. */
float beam_part_sigma(const struct beam *beam, const struct beam_sight *sight, const double n[3], double range_m,
                      const struct beam_part *part)
{
    double along = vec3_dot(n, sight->dir), a1 = vec3_dot(n, sight->e1) / along, a2 = vec3_dot(n, sight->e2) / along;
    double by_x = -beam->exit_radius_m * a1 - range_m * beam->slope * a2;
    double by_y = -beam->exit_radius_m * a2 + range_m * beam->slope * a1;
    double variance = by_x * by_x * part->xx + 2.0 * by_x * by_y * part->xy + by_y * by_y * part->yy;
    return (float)sqrt(variance > 0.0 ? variance : 0.0);
}

float beam_round_sigma(const struct beam *beam, double range_m, double cosine, double variance)
{
    double tan2 = 1.0 / fmax(cosine * cosine, 1e-12) - 1.0;
    return (float)(beam_radius(beam, range_m) * sqrt(fmax(0.0, variance * tan2)));
}

double beam_echo_width(double pulse_m, double variance_m2)
{
    return variance_m2 == 0.0 ? pulse_m : sqrt(pulse_m * pulse_m + 8.0 * M_LN2 * variance_m2);
}

/* Returns the row of the tables for h, and the part of the way from there to the next row. */
static uint32_t look_up(double h, double *part)
{
    double at = (h + 1.0) * (0.5 * BEAM_HALF_STEPS);
    uint32_t i = at <= 0.0 ? 0 : at >= BEAM_HALF_STEPS ? BEAM_HALF_STEPS - 1 : (uint32_t)at;
    *part = at - i;
    return i;
}

void beam_half(const struct beam *beam, double h, double *energy, double *moment)
{
    double part;
    uint32_t i = look_up(h, &part);
    *energy = beam->half[i] + (beam->half[i + 1] - beam->half[i]) * part;
    *moment = beam->moment[i] + (beam->moment[i + 1] - beam->moment[i]) * part;
}

void beam_half_squares(const struct beam *beam, double h, double *along, double *across)
{
    double part;
    uint32_t i = look_up(h, &part);
    *along = beam->along[i] + (beam->along[i + 1] - beam->along[i]) * part;
    *across = beam->across[i] + (beam->across[i + 1] - beam->across[i]) * part;
}

void beam_rings(uint32_t rings, struct beam_pattern *pattern)
{
    const double all = 1.0 - exp(-2.0);
    memset(pattern, 0, sizeof *pattern);
    pattern->n = 1 + 3 * rings * (rings + 1);
    pattern->rest = 0.5 * mean_t();
    for (uint32_t k = 1, at = 1; k <= rings; k++) {
        /* energy inside of the middle of this ring's annulus */
        double inside = (1.0 + 3.0 * k * (k - 1) + 3.0 * k) / pattern->n;
        double radius = sqrt(-0.5 * log(1.0 - inside * all));
        /* the ring has 6 k places; x^2 and y^2 each have a mean of half of radius^2 */
        pattern->rest -= 3.0 * k * radius * radius / pattern->n;
        for (uint32_t i = 0; i < 6 * k; i++, at++) {
            double phi = 2.0 * M_PI * (i + 0.5 * (k % 2)) / (6 * k);
            pattern->x[at] = (float)(radius * cos(phi));
            pattern->y[at] = (float)(radius * sin(phi));
        }
    }
}

/* With 1 to 18 rings the result is an upper bound of the errors of all cuts that leave 1 % of the energy or more
 * (test_beam.c). Without rings the centre is the only sub-ray. It may stand for a sliver at the rim, one radius
 * away. */
double beam_end_error(uint32_t rings)
{
    return rings == 0 ? 1.0 : 0.35 * pow(rings, -0.75);
}

/* T. Duff and others, Building an Orthonormal Basis, Revisited, JCGT 6(1), 2017. */
void beam_axes(const double d[3], double e1[3], double e2[3])
{
    double sign = copysign(1.0, d[2]), a = -1.0 / (sign + d[2]), b = d[0] * d[1] * a;
    e1[0] = 1.0 + sign * d[0] * d[0] * a;
    e1[1] = sign * b;
    e1[2] = -sign * d[0];
    e2[0] = b;
    e2[1] = sign + d[1] * d[1] * a;
    e2[2] = -d[1];
}
