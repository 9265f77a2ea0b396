/* SPDX-License-Identifier: MIT */
#include "tests/unit/soups.h"

#include <math.h>
#include <string.h>

#include "core/vec3.h"
#include "tests/common/cases.h"

double between(uint64_t *state, double lo, double hi)
{
    return lo + (hi - lo) * case_unit(state);
}

static uint32_t add_vertex(struct soup *s, const double p[3])
{
    for (uint32_t i = 0; i < s->n_vertices; i++)
        if (memcmp(s->vertex[i], p, sizeof s->vertex[i]) == 0) return i;
    memcpy(s->vertex[s->n_vertices], p, sizeof s->vertex[0]);
    return s->n_vertices++;
}

void add(struct soup *s, const double a[3], const double b[3], const double c[3])
{
    if (s->n == MOST) return;
    s->label[s->n] = (uint16_t)(s->n % 5);
    const uint32_t t[3] = {add_vertex(s, a), add_vertex(s, b), add_vertex(s, c)};
    if (t[0] == t[1] || t[1] == t[2] || t[2] == t[0]) return;
    memcpy(s->triangle[s->n++], t, sizeof t);
}

void any_point(uint64_t *state, double half, double p[3])
{
    for (int k = 0; k < 3; k++)
        p[k] = between(state, -half, half);
}

static void near_point(uint64_t *state, const double at[3], double most, double p[3])
{
    any_point(state, most, p);
    vec3_add(p, at, p);
}

/* Triangles lie anywhere, in all sizes. Every third one is a needle. */
static void soup_of_any(struct soup *s, uint64_t *state)
{
    const uint32_t n = (uint32_t)case_between(state, 2, 300);
    for (uint32_t i = 0; i < n; i++) {
        double a[3], b[3], c[3], size = exp(between(state, -5.0, 2.5));
        any_point(state, 10.0, a);
        near_point(state, a, size, b);
        near_point(state, i % 3 == 0 ? b : a, i % 3 == 0 ? size * exp(between(state, -12.0, -1.0)) : size, c);
        add(s, a, b, c);
    }
}

/* Sheets in common planes are cut into triangles in different ways. Some faces stand there twice. */
static void soup_of_overlaps(struct soup *s, uint64_t *state)
{
    const uint32_t sheets = (uint32_t)case_between(state, 2, 30);
    const double tilt = case_between(state, 0, 1) ? 0.0 : 0.37;
    for (uint32_t i = 0; i < sheets; i++) {
        const int axis = (int)case_between(state, 0, 2);
        const double at = 0.5 * (double)case_between(state, -8, 8), x0 = 0.25 * (double)case_between(state, -20, 16),
                     y0 = 0.25 * (double)case_between(state, -20, 16), w = 0.25 * (double)case_between(state, 1, 24),
                     h = 0.25 * (double)case_between(state, 1, 24);
        double corner[4][3];
        for (int k = 0; k < 4; k++) {
            const double x = x0 + (k == 1 || k == 2 ? w : 0.0), y = y0 + (k >= 2 ? h : 0.0);
            corner[k][axis] = at + tilt * x;
            corner[k][(axis + 1) % 3] = x;
            corner[k][(axis + 2) % 3] = y;
        }
        add(s, corner[0], corner[1], corner[2]);
        add(s, corner[0], corner[2], corner[3]);
        if (case_between(state, 0, 3) == 0) add(s, corner[2], corner[0], corner[1]); /* twice */
        if (case_between(state, 0, 3) == 0) add(s, corner[1], corner[3], corner[0]);
    }
}

/* Sheets lie one after the other, so near that float can hardly tell them apart. */
static void soup_of_layers(struct soup *s, uint64_t *state)
{
    const uint32_t n = (uint32_t)case_between(state, 2, 60);
    double a[3], b[3], c[3];
    for (uint32_t i = 0; i < n; i++) {
        if (i % 6 == 0) {
            any_point(state, 8.0, a);
            any_point(state, 8.0, b);
            any_point(state, 8.0, c);
        }
        const double gap = exp(between(state, -32.0, -9.0));
        double p[3], q[3], r[3];
        near_point(state, a, gap, p);
        near_point(state, b, gap, q);
        near_point(state, c, gap, r);
        add(s, p, q, r);
    }
}

/* Sheets are folded at shared edges and corners, at all angles. */
static void soup_of_folds(struct soup *s, uint64_t *state)
{
    const uint32_t n = (uint32_t)case_between(state, 1, 40);
    for (uint32_t i = 0; i < n; i++) {
        double a[3], b[3], c[3], d[3], e[3];
        any_point(state, 8.0, a);
        any_point(state, 8.0, b);
        any_point(state, 8.0, c);
        near_point(state, c, exp(between(state, -12.0, 2.0)), d);
        near_point(state, b, exp(between(state, -12.0, 2.0)), e);
        add(s, a, b, c);
        add(s, d, b, a);
        if (i % 2 == 0) add(s, e, d, a);
    }
}

/* Boxes have common corners and faces, and some are within others. */
static void soup_of_boxes(struct soup *s, uint64_t *state)
{
    static const int face[12][3] = {{0, 2, 1}, {1, 2, 3}, {4, 5, 6}, {5, 7, 6}, {0, 1, 4}, {1, 5, 4},
                                    {2, 6, 3}, {3, 6, 7}, {0, 4, 2}, {2, 4, 6}, {1, 3, 5}, {3, 7, 5}};
    const uint32_t n = (uint32_t)case_between(state, 1, 24);
    for (uint32_t i = 0; i < n; i++) {
        double lo[3], hi[3], corner[8][3];
        for (int k = 0; k < 3; k++) {
            lo[k] = 0.5 * (double)case_between(state, -12, 8);
            hi[k] = lo[k] + 0.5 * (double)case_between(state, 1, 12);
        }
        for (int c = 0; c < 8; c++)
            for (int k = 0; k < 3; k++)
                corner[c][k] = c >> k & 1 ? hi[k] : lo[k];
        for (int f = 0; f < 12; f++)
            add(s, corner[face[f][0]], corner[face[f][1]], corner[face[f][2]]);
    }
}

/* Dust: many small triangles that follow each other in the list lie close together, before and behind large ones. */
static void soup_of_dust(struct soup *s, uint64_t *state)
{
    enum { GRAINS = 32, LARGE = 40 };
    double middle[3] = {0}, size = 1.0;
    for (uint32_t i = 0; i + LARGE < MOST; i++) {
        double a[3], b[3], c[3];
        if (i % GRAINS == 0) {
            any_point(state, 10.0, middle);
            size = exp(between(state, -6.0, 0.0));
        }
        near_point(state, middle, size, a);
        near_point(state, a, 0.3 * size, b);
        near_point(state, a, 0.3 * size, c);
        add(s, a, b, c);
    }
    for (uint32_t i = (uint32_t)case_between(state, 0, LARGE); i < LARGE; i++) {
        double a[3], b[3], c[3];
        any_point(state, 10.0, a);
        near_point(state, a, 8.0, b);
        near_point(state, a, 8.0, c);
        add(s, a, b, c);
    }
}

void (*const SOUPS[N_SOUPS])(struct soup *, uint64_t *) = {soup_of_any,   soup_of_overlaps, soup_of_layers,
                                                           soup_of_folds, soup_of_boxes,    soup_of_dust};
