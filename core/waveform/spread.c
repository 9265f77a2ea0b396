/* SPDX-License-Identifier: MIT */
/* How a return's energy spreads over time: as pulses at nodes, by quadrature. */
#include <math.h>
#include <stdlib.h>

#include "core/vecmath.h"
#include "core/waveform/waveform_inside.h"

/* 3, 8, 12, 16, 24, 32, ... */
static uint32_t nodes_of(uint32_t level)
{
    if (level == 0) return 3;
    return level % 2 == 1 ? 8U << level / 2 : 12U << (level / 2 - 1);
}

/* The marginal of the irradiance exp(-2 r^2) within the unit disc, by sqrt(1 - x^2), times the weight sin^2 of Gauss's
 * and Chebyshev's nodes (second kind) at x = cos a: their weight function is the square root, and the rest is entire. */
static struct waveform_node disc_node(uint32_t i, uint32_t n)
{
    const double a = M_PI * (i + 1) / (n + 1), x = cos(a), y = sin(a);
    return (struct waveform_node){x, exp(-2.0 * x * x) * erf(M_SQRT2 * y) * y};
}

/* The Gaussian at even steps. The trapezoidal rule's error falls as fast as the spectrum of what it sums. */
static struct waveform_node bell_node(uint32_t i, uint32_t n)
{
    const double x = WAVEFORM_BELL_END * ((2.0 * i + 1.0) / n - 1.0);
    return (struct waveform_node){x, exp(-0.5 * x * x)};
}

/* Gauss's three nodes, which have the moments up to 5 that the finest level has. Returns the second. */
static double three_nodes(struct waveform_node *node, const struct waveform_node *fine, uint32_t n)
{
    double m2 = 0.0, m4 = 0.0;
    for (uint32_t i = 0; i < n; i++) {
        double x2 = fine[i].x * fine[i].x;
        m2 += fine[i].weight * x2;
        m4 += fine[i].weight * x2 * x2;
    }
    const double side = 0.5 * m2 * m2 / m4, x = sqrt(m4 / m2);
    node[0] = (struct waveform_node){-x, side};
    node[1] = (struct waveform_node){0.0, 1.0 - 2.0 * side};
    node[2] = (struct waveform_node){x, side};
    return m2;
}

/* Error below 1e-5 of the amplitude (tests/unit/test_waveform.c): the next term of three nodes, and for others what is
 * left of h's spectrum where the nodes no longer follow it. */
static double reach_of(enum waveform_spread spread, uint32_t n)
{
    if (n == 3) return spread == WAVEFORM_DISC ? 0.5 : 0.2;
    if (spread == WAVEFORM_DISC) return (n - 5.0) / 2.6;
    const double steps = n / 8.0;
    return steps > 1.0 ? sqrt(steps * steps - 1.0) : 0.0;
}

int waveform_rule_make(enum waveform_spread spread, struct waveform_rule *rule, struct sh_err *err)
{
    uint32_t total = 0;
    for (uint32_t k = 0; k < WAVEFORM_LEVELS; k++) {
        rule->first[k] = total;
        rule->reach[k] = reach_of(spread, nodes_of(k));
        total += nodes_of(k);
    }
    rule->first[WAVEFORM_LEVELS] = total;
    rule->node = malloc(total * sizeof *rule->node);
    if (rule->node == NULL) return sh_fail(err, SH_ENOMEM, "waveform: no memory");
    for (uint32_t k = 1; k < WAVEFORM_LEVELS; k++) {
        struct waveform_node *node = rule->node + rule->first[k];
        const uint32_t n = nodes_of(k);
        double sum = 0.0;
        for (uint32_t i = 0; i < n; i++) {
            node[i] = spread == WAVEFORM_DISC ? disc_node(i, n) : bell_node(i, n);
            sum += node[i].weight;
        }
        for (uint32_t i = 0; i < n; i++)
            node[i].weight /= sum;
    }
    rule->square =
        three_nodes(rule->node, rule->node + rule->first[WAVEFORM_LEVELS - 1], nodes_of(WAVEFORM_LEVELS - 1));
    return SH_OK;
}

void waveform_rule_free(struct waveform_rule *rule)
{
    free(rule->node);
}

/* h between its steps, by the cubic through four of them. All samples lie at the same place between steps. */
VEC_CLONES
static void add_pulse(const struct waveform_pulse *pulse, double amplitude, double centre, uint32_t n,
                      double *restrict signal)
{
    const double at = pulse->centroid - centre * pulse->phases, whole = floor(at), f = at - whole;
    const int64_t phases = pulse->phases, step = (int64_t)whole - 1;
    const int64_t k = step >= 0 ? step / phases : -((phases - 1 - step) / phases), phase = step - k * phases;
    const int64_t from = k < 0 ? -k : 0, to = (int64_t)pulse->length - k < n ? (int64_t)pulse->length - k : n;
    const double c[4] = {-amplitude * f * (f - 1.0) * (f - 2.0) / 6.0,
                         amplitude * (f + 1.0) * (f - 1.0) * (f - 2.0) / 2.0,
                         -amplitude * (f + 1.0) * f * (f - 2.0) / 2.0, amplitude * (f + 1.0) * f * (f - 1.0) / 6.0};
    const double *row[4];
    if (from >= to) return;
    for (int64_t j = 0; j < 4; j++) {
        int64_t over = phase + j >= phases;
        row[j] = pulse->h + (phase + j - over * phases) * pulse->pitch + k + over + from;
    }
    const double *restrict r0 = row[0], *restrict r1 = row[1], *restrict r2 = row[2], *restrict r3 = row[3];
    double *restrict out = signal + from;
    const int64_t m = to - from;
    for (int64_t i = 0; i < m; i++)
        out[i] += (c[0] * r0[i] + c[1] * r1[i]) + (c[2] * r2[i] + c[3] * r3[i]);
}

static const struct waveform_rule *rule_of(const struct waveform *w, const struct waveform_return *part)
{
    return part->spread == WAVEFORM_DISC ? &w->disc : &w->bell;
}

/* In samples. Extents beyond the last level count as that. */
static double extent_of(const struct waveform *w, const struct waveform_return *part)
{
    if (part->spread == WAVEFORM_POINT) return 0.0;
    return fmin(part->extent_m * w->samples_1_m, rule_of(w, part)->reach[WAVEFORM_LEVELS - 1] * w->pulse.scale);
}

/* The ranges on a plane rise as 1 / (1 - b x) across the disc, b = extent / range where the beam has spread far beyond its
 * exit. This is b up to the half that core/footprint.h has, for the second term of the series. */
static double bend_of(const struct waveform_return *part)
{
    if (part->spread != WAVEFORM_DISC) return 0.0;
    return part->extent_m < 0.5 * part->range_m ? part->extent_m / part->range_m : 0.5;
}

double waveform_reach(const struct waveform *w, const struct waveform_return *part)
{
    return extent_of(w, part) * (part->spread == WAVEFORM_BELL ? WAVEFORM_BELL_END : 1.0 + bend_of(part));
}

void waveform_add(const struct waveform *w, const struct waveform_return *part, double centre, uint32_t n,
                  double *signal)
{
    const double extent = extent_of(w, part), bend = bend_of(part);
    const struct waveform_rule *rule = rule_of(w, part);
    uint32_t level = 0;
    if (extent == 0.0) {
        add_pulse(&w->pulse, part->amplitude, centre, n, signal);
        return;
    }
    while (level + 1 < WAVEFORM_LEVELS && extent > rule->reach[level] * w->pulse.scale)
        level++;
    for (uint32_t i = rule->first[level]; i < rule->first[level + 1]; i++) {
        const struct waveform_node *node = &rule->node[i];
        const double x = node->x + bend * (node->x * node->x - rule->square);
        add_pulse(&w->pulse, part->amplitude * node->weight, centre + extent * x, n, signal);
    }
}
