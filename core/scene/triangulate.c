/* SPDX-License-Identifier: MIT */
#include "core/scene/triangulate.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/err.h"
#include "core/grow.h"
#include "core/vec3.h"

int triangulate_reserve(struct triangulate *t, size_t n)
{
    return grow(&t->at, &t->cap, n, sizeof *t->at) ? SH_OK : SH_ENOMEM;
}

void triangulate_free(struct triangulate *t)
{
    free(t->at);
    *t = (struct triangulate){0};
}

/* Below this share of the areas that it adds up, a normal may be rounding alone, whose direction means nothing. Files
 * often have three decimals: corners are off by up to 0.5 mm in each axis, 0.9 mm in all. At sides of 0.3 m that is
 * 0.003 of a side, and the corners of both edges count: so up to 0.01. Bow-ties of that size had 0.0029. */
#define DOUBTFUL_SHARE 1e-2
/* Below this share the polygon has no inner side: parts of it turn left, and as much turns right. */
#define NO_AREA_SHARE 1e-12

/* Adds the triangles of a fan about the first corner. Returns the axis to project along: the largest component of their
 * sum, or, where they cancel each other as those of a bow-tie do, of the largest triangle. */
static int choose_axis(struct triangulate *t, uint32_t n, double normal[3])
{
    double largest[3] = {0, 0, 0}, sum = 0;
    for (uint32_t i = 1; i + 1 < n; i++) {
        double across[3];
        vec3_normal(t->at[0].p, t->at[i].p, t->at[i + 1].p, across);
        vec3_add(normal, across, normal);
        sum += vec3_length(across);
        if (vec3_length(across) > vec3_length(largest)) memcpy(largest, across, sizeof largest);
    }
    const double length = vec3_length(normal), *along = length < DOUBTFUL_SHARE * sum ? largest : normal;
    if (length < NO_AREA_SHARE * sum) t->simple = false;
    int axis = 0;
    for (int k = 1; k < 3; k++)
        if (fabs(along[k]) > fabs(along[axis])) axis = k;
    return axis;
}

/* Coordinates count from the first corner, since products of UTM coordinates would lose the polygon to rounding. */
static void project(struct triangulate *t, uint32_t n)
{
    double normal[3] = {0, 0, 0};
    const int axis = choose_axis(t, n, normal);
    int u = (axis + 1) % 3, v = (axis + 2) % 3;
    if (normal[axis] < 0) {
        int swap = u;
        u = v;
        v = swap;
    }
    for (uint32_t i = 0; i < n; i++) {
        t->at[i].uv[0] = t->at[i].p[u] - t->at[0].p[u];
        t->at[i].uv[1] = t->at[i].p[v] - t->at[0].p[v];
    }
}

/* Twice the signed area of the triangle (a, b, c): positive for a left turn. */
static double triangulate_turn(const struct triangulate *t, uint32_t a, uint32_t b, uint32_t c)
{
    const double *p = t->at[a].uv, *q = t->at[b].uv, *r = t->at[c].uv;
    return (q[0] - p[0]) * (r[1] - p[1]) - (q[1] - p[1]) * (r[0] - p[0]);
}

static bool same_place(const struct triangulate *t, uint32_t a, uint32_t b)
{
    return t->at[a].uv[0] == t->at[b].uv[0] && t->at[a].uv[1] == t->at[b].uv[1];
}

static bool is_clipped(const struct triangulate *t, uint32_t i)
{
    return t->at[i].next == i;
}

/* A corner at the same place as one of the ear's is the other side of a keyhole and doesn't block it. */
static bool blocks(const struct triangulate *t, uint32_t i, uint32_t a, uint32_t b, uint32_t c)
{
    if (i == a || i == b || i == c || is_clipped(t, i)) return false;
    if (same_place(t, i, a) || same_place(t, i, b) || same_place(t, i, c)) return false;
    return triangulate_turn(t, a, b, i) >= 0 && triangulate_turn(t, b, c, i) >= 0 && triangulate_turn(t, c, a, i) >= 0;
}

static bool is_ear(const struct triangulate *t, uint32_t i)
{
    uint32_t a = t->at[i].prev, c = t->at[i].next;
    if (!(triangulate_turn(t, a, i, c) > 0)) return false;
    for (size_t k = 0; k < t->n_reflex; k++)
        if (blocks(t, t->at[k].reflex, a, i, c)) return false;
    return true;
}

static void clip(struct triangulate *t, uint32_t i, uint32_t *n_out)
{
    uint32_t a = t->at[i].prev, c = t->at[i].next;
    uint32_t *out = t->at[(*n_out)++].triangle;
    out[0] = a;
    out[1] = i;
    out[2] = c;
    t->at[a].next = c;
    t->at[c].prev = a;
    t->at[i].next = i;
}

/* No ear is left. A corner without area is taken, since nothing is lost by it. Where there is none, the polygon crosses
 * itself, and a convex corner is taken. */
static uint32_t forced_corner(struct triangulate *t, uint32_t start)
{
    uint32_t convex = start, i = start;
    do {
        double area = triangulate_turn(t, t->at[i].prev, i, t->at[i].next);
        if (area == 0) return i;
        if (area > 0) convex = i;
        i = t->at[i].next;
    } while (i != start);
    t->simple = false;
    return convex;
}

/* Ears turn left. If the last triangle turns right, by more than rounding, edges have crossed. */
static bool is_turned_over(const struct triangulate *t, uint32_t a, uint32_t b, uint32_t c)
{
    double u = t->at[b].uv[0] - t->at[a].uv[0], v = t->at[b].uv[1] - t->at[a].uv[1];
    double s = t->at[c].uv[0] - t->at[a].uv[0], w = t->at[c].uv[1] - t->at[a].uv[1];
    return triangulate_turn(t, a, b, c) < -1e-12 * (u * u + v * v + s * s + w * w);
}

void triangulate_polygon(struct triangulate *t, uint32_t n)
{
    t->simple = true;
    t->stopped = false;
    t->n_reflex = 0;
    project(t, n);
    for (uint32_t i = 0; i < n; i++) {
        t->at[i].next = i + 1 < n ? i + 1 : 0;
        t->at[i].prev = i > 0 ? i - 1 : n - 1;
    }
    for (uint32_t i = 0; i < n; i++)
        if (!(triangulate_turn(t, t->at[i].prev, i, t->at[i].next) > 0)) t->at[t->n_reflex++].reflex = i;
    uint32_t n_out = 0, left = n, tried = 0, i = 1; /* from 1: a convex polygon becomes a fan about corner 0 */
    for (uint32_t step = 1; left > 3; step++) {
        /* A polygon of 65,536 corners, the most that core/scene/build.h allows, may take seconds. */
        if (step % 16 == 0 && (t->stopped = sh_stopped(t->report))) return;
        uint32_t next = t->at[i].next;
        if (is_ear(t, i)) {
            clip(t, i, &n_out);
            left--;
            tried = 0;
        } else if (++tried >= left) {
            uint32_t corner = forced_corner(t, i);
            next = t->at[corner].next;
            clip(t, corner, &n_out);
            left--;
            tried = 0;
        }
        i = next;
    }
    if (is_turned_over(t, t->at[i].prev, i, t->at[i].next)) t->simple = false;
    clip(t, i, &n_out);
}
