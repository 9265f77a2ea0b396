/* SPDX-License-Identifier: MIT */
/* A return that has an extent spreads over time. The return's signal is a sum of pulses, one for each node of a
 * quadrature rule. h is the outgoing pulse after the receiver (core/waveform.h). */
#include <math.h>
#include <stdlib.h>

#include "core/vecmath.h"
#include "core/waveform/waveform_inside.h"

/* Returns the number of nodes of a level: 3, 5, 12, 16, 24, 32, ... */
static uint32_t nodes_of(uint32_t level)
{
    if (level < 2) return 3 + 2 * level;
    return level % 2 == 1 ? 8U << level / 2 : 12U << (level / 2 - 1);
}

/* Returns node i of n of Gauss's and Chebyshev's rule (second kind), at x = cos a. The node's weight is sin^2 a times
 * the marginal of the irradiance exp(-2 r^2) within the unit disc, over sqrt(1 - x^2). That quotient is an entire
 * function, so the rule converges fast. */
static struct waveform_node disc_node(uint32_t i, uint32_t n)
{
    const double a = M_PI * (i + 1) / (n + 1), x = cos(a), y = sin(a);
    return (struct waveform_node){x, exp(-2.0 * x * x) * erf(M_SQRT2 * y) * y};
}

/* Returns node i of n of the Gaussian, at even steps. The trapezoidal rule's error falls as fast as
 * the Gaussian's spectrum. */
static struct waveform_node bell_node(uint32_t i, uint32_t n)
{
    const double x = WAVEFORM_BELL_END * ((2.0 * i + 1.0) / n - 1.0);
    return (struct waveform_node){x, exp(-0.5 * x * x)};
}

/* Sets Gauss's nodes of a spread that is even in x, by its moments m: three nodes have the right moments up to the 5th,
 * five nodes up to the 9th. The nodes are the roots of the polynomials x (x^2 - a) and x (x^4 - a x^2 + b), which are
 * orthogonal to all of lower degree. */
static void gauss_nodes(struct waveform_node three[3], struct waveform_node five[5], const double m[10])
{
    const double a = (m[8] * m[2] - m[6] * m[4]) / (m[6] * m[2] - m[4] * m[4]), b = (a * m[4] - m[6]) / m[2];
    const double root = sqrt(a * a - 4.0 * b), near2 = 0.5 * (a - root), far2 = 0.5 * (a + root);
    const double near = 0.5 * (m[4] - far2 * m[2]) / (near2 * (near2 - far2));
    const double far = 0.5 * (m[4] - near2 * m[2]) / (far2 * (far2 - near2));
    const double only2 = m[4] / m[2], only = 0.5 * m[2] / only2;
    for (int side = -1; side <= 1; side++)
        three[side + 1] = (struct waveform_node){side * sqrt(only2), side == 0 ? 1.0 - 2.0 * only : only};
    five[0] = (struct waveform_node){-sqrt(far2), far};
    five[1] = (struct waveform_node){-sqrt(near2), near};
    five[2] = (struct waveform_node){0.0, 1.0 - 2.0 * (near + far)};
    five[3] = (struct waveform_node){sqrt(near2), near};
    five[4] = (struct waveform_node){sqrt(far2), far};
}

/* Returns the extent up to which n nodes have an error below 1e-5 of the amplitude (tests/unit/test_waveform.c). The
 * extent's unit is the scale of the pulse (waveform_inside.h). With Gauss's nodes the error is the next moment times
 * the next derivative of h. With the other nodes the error is the part of h's spectrum that the nodes no longer
 * follow. */
static double reach_of(enum waveform_spread spread, uint32_t n)
{
    if (n == 3) return spread == WAVEFORM_DISC ? 0.5 : 0.2;
    if (n == 5) return spread == WAVEFORM_DISC ? 1.5 : 0.42;
    if (spread == WAVEFORM_DISC) return (n - 4.0) / 2.25;
    return n / 6.5 - 1.0;
}

static void even_nodes(enum waveform_spread spread, uint32_t n, struct waveform_node *node)
{
    double sum = 0.0;
    for (uint32_t i = 0; i < n; i++) {
        node[i] = spread == WAVEFORM_DISC ? disc_node(i, n) : bell_node(i, n);
        sum += node[i].weight;
    }
    for (uint32_t i = 0; i < n; i++)
        node[i].weight /= sum;
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
    for (uint32_t k = 2; k < WAVEFORM_LEVELS; k++)
        even_nodes(spread, nodes_of(k), rule->node + rule->first[k]);
    const struct waveform_node *fine = rule->node + rule->first[WAVEFORM_LEVELS - 1];
    double m[10] = {0.0};
    for (uint32_t i = 0; i < WAVEFORM_MOST_NODES; i++)
        for (int k = 2; k < 10; k += 2)
            m[k] += fine[i].weight * pow(fine[i].x, k);
    gauss_nodes(rule->node, rule->node + rule->first[1], m);
    rule->square = m[2];
    return SH_OK;
}

void waveform_rule_free(struct waveform_rule *rule)
{
    free(rule->node);
}

/* Adds a pulse to the signal. Between the steps of h, its value is that of the cubic through four steps. Steps divide a
 * sample evenly, so all samples have the same place between two steps, and the same four coefficients. */
VEC_CLONES
static void add_pulse(const struct waveform_pulse *pulse, double amplitude, double centre, uint32_t n,
                      double *restrict signal)
{
    const double at = pulse->lead - centre, whole = floor(at), fine = (at - whole) * pulse->phases;
    const int64_t phases = pulse->phases, phase = (int64_t)fine, k = (int64_t)whole - (phase == 0);
    const int64_t from = k < 0 ? -k : 0, to = (int64_t)pulse->length - k < n ? (int64_t)pulse->length - k : n;
    const double f = fine - (double)phase;
    const double c[4] = {-amplitude * f * (f - 1.0) * (f - 2.0) / 6.0,
                         amplitude * (f + 1.0) * (f - 1.0) * (f - 2.0) / 2.0,
                         -amplitude * (f + 1.0) * f * (f - 2.0) / 2.0, amplitude * (f + 1.0) * f * (f - 1.0) / 6.0};
    const double *row[4];
    if (from >= to) return;
    for (int64_t j = 0; j < 4; j++) { /* steps phase - 1 .. phase + 2 of this sample, or of its neighbours */
        const int64_t step = phase - 1 + j, over = step < 0 ? -1 : step >= phases;
        row[j] = pulse->h + ((step - over * phases) * pulse->pitch + (int64_t)whole + over + from);
    }
    const double *restrict r0 = row[0], *restrict r1 = row[1], *restrict r2 = row[2], *restrict r3 = row[3];
    double *restrict out = signal + from;
    for (int64_t i = 0; i < to - from; i++)
        out[i] += (c[0] * r0[i] + c[1] * r1[i]) + (c[2] * r2[i] + c[3] * r3[i]);
}

static const struct waveform_rule *rule_of(const struct waveform *w, const struct waveform_return *part)
{
    return part->spread == WAVEFORM_DISC ? &w->disc : &w->bell;
}

/* Returns a return's extent in samples. An extent beyond the last level counts as that level's. */
static double extent_of(const struct waveform *w, const struct waveform_return *part)
{
    if (part->spread == WAVEFORM_POINT) return 0.0;
    return fmin(part->extent_m * w->samples_1_m, rule_of(w, part)->reach[WAVEFORM_LEVELS - 1] * w->pulse.scale);
}

/* The ranges on a plane rise as 1 / (1 - b x) across the disc, b = extent / range where the beam has spread far beyond
 * its exit. Returns b, limited to 0.5 as in core/footprint.h; b weighs the second term of the series. */
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
