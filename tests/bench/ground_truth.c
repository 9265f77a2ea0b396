/* SPDX-License-Identifier: MIT */
#include "tests/bench/ground_truth.h"

#include <math.h>
#include <stdlib.h>

enum { CELLS = 200 }; /* along each axis */

struct ground_truth {
    const struct scene *scene;
    double station_m[3];
    double min_m[2], cell_m[2], margin_m, reach_m; /* relative to the station */
    uint32_t *first;                               /* [CELLS * CELLS + 1] into list */
    uint32_t *list;
};

/* Gives the cells from..to that the interval touches with its margin. The margin is far more than double precision can
 * be wrong by. */
static void cells_of(const struct ground_truth *r, int axis, double lo, double hi, int *from, int *to)
{
    double a = (lo - r->margin_m - r->min_m[axis]) / r->cell_m[axis],
           b = (hi + r->margin_m - r->min_m[axis]) / r->cell_m[axis];
    *from = a < 0.0 ? 0 : a > CELLS ? CELLS : (int)a;
    *to = b < 0.0 ? -1 : b >= CELLS ? CELLS - 1 : (int)b;
}

static void triangle_cells(const struct ground_truth *r, uint32_t prim, int from[2], int to[2])
{
    for (int axis = 0; axis < 2; axis++) {
        double lo = INFINITY, hi = -INFINITY;
        for (int i = 0; i < 3; i++) {
            double x = r->scene->vertex_m[r->scene->triangle[prim][i]][axis] - r->station_m[axis];
            lo = fmin(lo, x);
            hi = fmax(hi, x);
        }
        cells_of(r, axis, lo, hi, &from[axis], &to[axis]);
    }
}

/* Counts the triangles of each cell (list NULL), or lists them. next is the place of the cell's next triangle. */
static void each_triangle(const struct ground_truth *r, uint32_t *next, uint32_t *list)
{
    for (uint32_t prim = 0; prim < r->scene->n_triangles; prim++) {
        int from[2], to[2];
        triangle_cells(r, prim, from, to);
        for (int y = from[1]; y <= to[1]; y++)
            for (int x = from[0]; x <= to[0]; x++) {
                uint32_t at = next[y * CELLS + x]++;
                if (list != NULL) list[at] = prim;
            }
    }
}

struct ground_truth *ground_truth_create(const struct scene *scene, const double station_m[3])
{
    struct ground_truth *r = calloc(1, sizeof *r);
    uint32_t *next = calloc(CELLS * CELLS, sizeof *next);
    if (r != NULL) r->first = calloc(CELLS * CELLS + 1, sizeof *r->first);
    if (r == NULL || next == NULL || r->first == NULL) goto failed;
    r->scene = scene;
    for (int i = 0; i < 3; i++) {
        r->station_m[i] = station_m[i];
        r->reach_m += scene->max_m[i] - scene->min_m[i];
    }
    r->reach_m *= 2.0;
    r->margin_m = 1e-6 * r->reach_m;
    for (int i = 0; i < 2; i++) {
        r->min_m[i] = scene->min_m[i] - station_m[i] - r->margin_m;
        r->cell_m[i] = (scene->max_m[i] - scene->min_m[i] + 2.0 * r->margin_m) / CELLS;
    }
    each_triangle(r, next, NULL);
    for (uint32_t i = 0; i < CELLS * CELLS; i++) {
        r->first[i + 1] = r->first[i] + next[i];
        next[i] = r->first[i];
    }
    r->list = malloc(r->first[CELLS * CELLS] * sizeof *r->list);
    if (r->list == NULL) goto failed;
    each_triangle(r, next, r->list);
    free(next);
    return r;
failed:
    free(next);
    ground_truth_free(r);
    return NULL;
}

void ground_truth_free(struct ground_truth *r)
{
    if (r == NULL) return;
    free(r->first);
    free(r->list);
    free(r);
}

static void cross(const long double a[3], const long double b[3], long double out[3])
{
    out[0] = a[1] * b[2] - a[2] * b[1];
    out[1] = a[2] * b[0] - a[0] * b[2];
    out[2] = a[0] * b[1] - a[1] * b[0];
}

static long double dot(const long double a[3], const long double b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

/* These are the ranges of the triangles that a ray has hit so far. */
struct first_hit {
    /* The border of a triangle belongs to it, and a little around that, so that there is no gap between neighbours in
     * long double. */
    long double range;
    long double around[2]; /* to the first triangle that it hits or just misses; [0] front, [1] back */
};

static void test_triangle(const struct ground_truth *r, uint32_t prim, const long double dir[3],
                          struct first_hit *first)
{
    const long double border = 1e-15L, around = 1e-11L;
    long double v[3][3], e1[3], e2[3], p[3], q[3], s[3];
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            v[i][j] = (long double)r->scene->vertex_m[r->scene->triangle[prim][i]][j] - (long double)r->station_m[j];
    for (int j = 0; j < 3; j++) {
        e1[j] = v[1][j] - v[0][j];
        e2[j] = v[2][j] - v[0][j];
        s[j] = -v[0][j];
    }
    cross(dir, e2, p);
    cross(s, e1, q);
    long double det = dot(e1, p), a = dot(s, p) / det, b = dot(dir, q) / det, t = dot(e2, q) / det;
    long double least = fminl(fminl(a, b), 1.0L - a - b);
    if (!(least >= -around) || !(t > 0.0L)) return;
    if (least >= -border) first->range = fminl(first->range, t);
    first->around[det < 0.0L] = fminl(first->around[det < 0.0L], t);
}

/* Gives the part of 0..reach in which the ray is within lo..hi of an axis. Returns 0 if there is none. */
static int part_within(double dir, double lo, double hi, double reach, double *t0, double *t1)
{
    double a = lo / dir, b = hi / dir;
    *t0 = fmax(0.0, fmin(a, b));
    *t1 = fmin(reach, fmax(a, b));
    if (fabs(dir) < 1e-300) {
        *t0 = 0.0;
        *t1 = lo <= 0.0 && hi >= 0.0 ? reach : -1.0;
    }
    return *t0 <= *t1;
}

long double ground_truth_range(const struct ground_truth *r, const double dir[3], int *doubtful)
{
    const long double d[3] = {dir[0], dir[1], dir[2]};
    const long double none = (long double)INFINITY;
    struct first_hit hit = {none, {none, none}};
    for (int y = 0; y < CELLS; y++) {
        double lo = r->min_m[1] + y * r->cell_m[1], t0, t1;
        if (!part_within(dir[1], lo - r->margin_m, lo + r->cell_m[1] + r->margin_m, r->reach_m, &t0, &t1)) continue;
        int from, to;
        cells_of(r, 0, fmin(t0 * dir[0], t1 * dir[0]), fmax(t0 * dir[0], t1 * dir[0]), &from, &to);
        for (int x = from; x <= to; x++)
            for (uint32_t i = r->first[y * CELLS + x]; i < r->first[y * CELLS + x + 1]; i++)
                test_triangle(r, r->list[i], d, &hit);
    }
    long double first = fminl(hit.around[0], hit.around[1]), second = fmaxl(hit.around[0], hit.around[1]);
    long double same = 1e-9L * hit.range;
    *doubtful = hit.range - first > same || second - first <= same;
    return hit.range;
}
