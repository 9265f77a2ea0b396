/* SPDX-License-Identifier: MIT */
/* Finds the stretches of an outline that are visible steps, or the end of a kind of surface. */
#include <math.h>

#include "core/footprint/outlines.h"
#include "core/vec3.h"

/* Rays pass the edge at this share of the footprint's radius: a thinner part of the scene could not make an echo. */
#define BESIDE 2e-3
/* Steeper surfaces than this look like a step, and count as one. */
#define SLOPE 20.0

static void aim_pair(struct outline_prober *prober, uint32_t i, const double at[3], const double normal[3],
                     double beside_m)
{
    for (uint32_t side = 0; side < 2; side++) {
        double d[3], length2 = 0.0, off = side == 0 ? beside_m : -beside_m;
        for (int k = 0; k < 3; k++) {
            d[k] = at[k] + off * normal[k];
            length2 += d[k] * d[k];
        }
        for (int k = 0; k < 3; k++)
            d[k] /= sqrt(length2);
        VEC3_SET(prober->dir, 2 * i + side, d);
    }
}

static uint8_t is_step(double a, double b, int same_kind, double edge_m, double beside_m)
{
    double slack_m = BEAM_LEAST_STEP_M + 2.0 * SLOPE * beside_m;
    if (isnan(a) && isnan(b)) return 0;
    if (a < edge_m - slack_m && b < edge_m - slack_m) return 0; /* hidden */
    return !same_kind || isnan(a) || isnan(b) || fabs(a - b) > slack_m;
}

uint32_t outline_probe(struct outline_prober *prober, const double p[3], const double q[3], double range_m)
{
    double e[3] = {q[0] - p[0], q[1] - p[1], q[2] - p[2]}, normal[3], at[3];
    double radius_m = beam_radius(prober->beam, range_m), beside_m = BESIDE * radius_m;
    uint8_t seen[PROBE_MOST];
    vec3_cross(p, q, normal);
    double length = sqrt(vec3_dot(normal, normal)), parts = ceil(sqrt(vec3_dot(e, e)) / radius_m);
    uint32_t n = parts < 1.0 ? 1 : parts > PROBE_MOST ? PROBE_MOST : (uint32_t)parts;
    if (!(length > 0.0)) { /* seen end-on: a point */
        prober->counts[0] = 1;
        return 1;
    }
    for (int k = 0; k < 3; k++)
        normal[k] /= length;
    for (uint32_t i = 0; i < n; i++) {
        for (int k = 0; k < 3; k++)
            at[k] = p[k] + e[k] * (i + 0.5) / n;
        aim_pair(prober, i, at, normal, beside_m);
    }
    prober->probe->cast(prober->probe->ctx, 2 * n, &VEC3_IN(prober->dir, 0), prober->range_m, prober->kind);
    for (uint32_t i = 0; i < n; i++) {
        for (int k = 0; k < 3; k++)
            at[k] = p[k] + e[k] * (i + 0.5) / n;
        int same = prober->kind[2 * i] == prober->kind[2 * i + 1];
        seen[i] = is_step(prober->range_m[2 * i], prober->range_m[2 * i + 1], same, sqrt(vec3_dot(at, at)), beside_m);
    }
    for (uint32_t i = 0; i < n; i++) /* parts next to a step count, too */
        prober->counts[i] = (uint8_t)(seen[i] | (i > 0 ? seen[i - 1] : 0) | (i + 1 < n ? seen[i + 1] : 0));
    return n;
}
