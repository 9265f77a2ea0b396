/* SPDX-License-Identifier: MIT */
/* Random small scenes, triangle by triangle. Each kind has surfaces that are hard to order along a ray. */
#ifndef TESTS_UNIT_SOUPS_H
#define TESTS_UNIT_SOUPS_H

#include <stdint.h>

enum { MOST = 400 }; /* triangles; more are left out */

struct soup {
    double vertex[3 * MOST][3];
    uint32_t triangle[MOST][3];
    uint16_t label[MOST];
    uint32_t n_vertices, n;
};

double between(uint64_t *state, double lo, double hi);

/* Draws a point of the cube from -half to half. */
void any_point(uint64_t *state, double half, double p[3]);

/* Adds a triangle. Corners in one place are one vertex. A triangle with two of them in one place is left out. */
void add(struct soup *s, const double a[3], const double b[3], const double c[3]);

/* The kinds. Each adds its triangles, which may be none. */
enum { N_SOUPS = 6 };
extern void (*const SOUPS[N_SOUPS])(struct soup *, uint64_t *state);

#endif
