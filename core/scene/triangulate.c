#include "core/scene/triangulate.h"

#include <math.h>
#include <stdlib.h>

#include "core/err.h"

static bool grow(void **array, size_t n, size_t size)
{
    void *bigger = realloc(*array, n * size);
    if (bigger == NULL) return false;
    *array = bigger;
    return true;
}

int triangulate_reserve(struct triangulate *t, size_t n)
{
    if (n <= t->cap) return SH_OK;
    size_t cap = n < 32 ? 64 : n * 2;
    if (!grow((void **)&t->p, cap, sizeof *t->p)) return SH_ENOMEM;
    if (!grow((void **)&t->triangle, cap, sizeof *t->triangle)) return SH_ENOMEM;
    if (!grow((void **)&t->uv, cap, sizeof *t->uv)) return SH_ENOMEM;
    if (!grow((void **)&t->next, cap, sizeof *t->next)) return SH_ENOMEM;
    if (!grow((void **)&t->prev, cap, sizeof *t->prev)) return SH_ENOMEM;
    if (!grow((void **)&t->reflex, cap, sizeof *t->reflex)) return SH_ENOMEM;
    t->cap = cap;
    return SH_OK;
}

void triangulate_free(struct triangulate *t)
{
    free(t->p);
    free(t->triangle);
    free(t->uv);
    free(t->next);
    free(t->prev);
    free(t->reflex);
    *t = (struct triangulate){0};
}

/* Differences from the first corner: at UTM coordinates the products would lose the polygon otherwise. */
static void project(struct triangulate *t, uint32_t n)
{
    double normal[3] = {0, 0, 0};
    for (uint32_t i = 1; i + 1 < n; i++) {
        double a[3], b[3];
        for (int k = 0; k < 3; k++) {
            a[k] = t->p[i][k] - t->p[0][k];
            b[k] = t->p[i + 1][k] - t->p[0][k];
        }
        normal[0] += a[1] * b[2] - a[2] * b[1];
        normal[1] += a[2] * b[0] - a[0] * b[2];
        normal[2] += a[0] * b[1] - a[1] * b[0];
    }
    int axis = 0;
    for (int k = 1; k < 3; k++)
        if (fabs(normal[k]) > fabs(normal[axis])) axis = k;
    int u = (axis + 1) % 3, v = (axis + 2) % 3;
    if (normal[axis] < 0) {
        int swap = u;
        u = v;
        v = swap;
    }
    for (uint32_t i = 0; i < n; i++) {
        t->uv[i][0] = t->p[i][u] - t->p[0][u];
        t->uv[i][1] = t->p[i][v] - t->p[0][v];
    }
}

/* Twice the signed area of the triangle (a, b, c): positive for a left turn. */
static double turn(const struct triangulate *t, uint32_t a, uint32_t b, uint32_t c)
{
    const double *p = t->uv[a], *q = t->uv[b], *r = t->uv[c];
    return (q[0] - p[0]) * (r[1] - p[1]) - (q[1] - p[1]) * (r[0] - p[0]);
}

static bool same_place(const struct triangulate *t, uint32_t a, uint32_t b)
{
    return t->uv[a][0] == t->uv[b][0] && t->uv[a][1] == t->uv[b][1];
}

static bool is_clipped(const struct triangulate *t, uint32_t i)
{
    return t->next[i] == i;
}

/* A corner at the same place as one of the ear's is the other side of a keyhole and doesn't block it. */
static bool blocks(const struct triangulate *t, uint32_t i, uint32_t a, uint32_t b, uint32_t c)
{
    if (i == a || i == b || i == c || is_clipped(t, i)) return false;
    if (same_place(t, i, a) || same_place(t, i, b) || same_place(t, i, c)) return false;
    return turn(t, a, b, i) >= 0 && turn(t, b, c, i) >= 0 && turn(t, c, a, i) >= 0;
}

static bool is_ear(const struct triangulate *t, uint32_t i)
{
    uint32_t a = t->prev[i], c = t->next[i];
    if (!(turn(t, a, i, c) > 0)) return false;
    for (size_t k = 0; k < t->n_reflex; k++)
        if (blocks(t, t->reflex[k], a, i, c)) return false;
    return true;
}

static void clip(struct triangulate *t, uint32_t i, uint32_t *n_out)
{
    uint32_t a = t->prev[i], c = t->next[i];
    uint32_t *out = t->triangle[(*n_out)++];
    out[0] = a;
    out[1] = i;
    out[2] = c;
    t->next[a] = c;
    t->prev[c] = a;
    t->next[i] = i;
}

/* No ear is left: take a corner without area (nothing is lost), else the polygon crosses itself. */
static uint32_t forced_corner(struct triangulate *t, uint32_t start)
{
    uint32_t convex = start, i = start;
    do {
        double area = turn(t, t->prev[i], i, t->next[i]);
        if (area == 0) return i;
        if (area > 0) convex = i;
        i = t->next[i];
    } while (i != start);
    t->simple = false;
    return convex;
}

/* Ears turn left; if what is left over at last turns right, by more than rounding, edges have crossed. */
static bool is_turned_over(const struct triangulate *t, uint32_t a, uint32_t b, uint32_t c)
{
    double u = t->uv[b][0] - t->uv[a][0], v = t->uv[b][1] - t->uv[a][1];
    double s = t->uv[c][0] - t->uv[a][0], w = t->uv[c][1] - t->uv[a][1];
    return turn(t, a, b, c) < -1e-12 * (u * u + v * v + s * s + w * w);
}

void triangulate_polygon(struct triangulate *t, uint32_t n)
{
    t->simple = true;
    t->n_reflex = 0;
    project(t, n);
    for (uint32_t i = 0; i < n; i++) {
        t->next[i] = i + 1 < n ? i + 1 : 0;
        t->prev[i] = i > 0 ? i - 1 : n - 1;
    }
    for (uint32_t i = 0; i < n; i++)
        if (!(turn(t, t->prev[i], i, t->next[i]) > 0)) t->reflex[t->n_reflex++] = i;
    uint32_t n_out = 0, left = n, tried = 0, i = 1; /* from 1: a convex polygon becomes a fan about corner 0 */
    while (left > 3) {
        uint32_t next = t->next[i];
        if (is_ear(t, i)) {
            clip(t, i, &n_out);
            left--;
            tried = 0;
        } else if (++tried >= left) {
            uint32_t corner = forced_corner(t, i);
            next = t->next[corner];
            clip(t, corner, &n_out);
            left--;
            tried = 0;
        }
        i = next;
    }
    if (is_turned_over(t, t->prev[i], i, t->next[i])) t->simple = false;
    clip(t, i, &n_out);
}
