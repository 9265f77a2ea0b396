/* SPDX-License-Identifier: MIT */
#include "tests/common/reference.h"

#include <math.h>
#include <stdlib.h>

typedef long double ext;

struct reference {
    const double (*vertex)[3];
    const uint32_t (*triangle)[3];
    uint32_t n_triangles;
    double min_m[3], cell_m[3];
    int32_t cells[3];
    uint32_t *start, *list; /* triangles of cell c: list[start[c]] .. list[start[c + 1] - 1] */
};

/* A triangle as seen from the ray's origin. */
struct view {
    ext corner[3][3];
    ext side[3]; /* of edge i: n . dir has their common sign where the ray meets the triangle */
};

static ext dot(const ext a[3], const ext b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static void cross(const ext a[3], const ext b[3], ext out[3])
{
    out[0] = a[1] * b[2] - a[2] * b[1];
    out[1] = a[2] * b[0] - a[0] * b[2];
    out[2] = a[0] * b[1] - a[1] * b[0];
}

static int comes_before(const ext a[3], const ext b[3])
{
    for (int k = 0; k < 3; k++)
        if (a[k] != b[k]) return a[k] < b[k];
    return 0;
}

/* Returns dir . (a x b), with the corners in one order, so that both triangles of an edge get the same number. */
static ext side_of(const ext a[3], const ext b[3], const ext dir[3])
{
    int swap = comes_before(b, a);
    const ext *p = swap ? b : a, *q = swap ? a : b;
    ext e[3] = {q[0] - p[0], q[1] - p[1], q[2] - p[2]}, n[3];
    cross(p, e, n);
    return swap ? -dot(dir, n) : dot(dir, n);
}

static void look(const struct reference *r, uint32_t triangle, const double origin[3], const ext dir[3],
                 struct view *view)
{
    for (int i = 0; i < 3; i++)
        for (int k = 0; k < 3; k++)
            view->corner[i][k] = (ext)r->vertex[r->triangle[triangle][i]][k] - (ext)origin[k];
    for (int i = 0; i < 3; i++)
        view->side[i] = side_of(view->corner[i], view->corner[(i + 1) % 3], dir);
}

/* Returns whether the ray surely misses, in double with a margin of twice its rounding. This test saves nearly all of
 * the long double work. */
static int surely_misses(const struct reference *r, uint32_t triangle, const double origin[3], const double dir[3])
{
    double v[3][3], side[3], size = 0.0;
    for (int i = 0; i < 3; i++) {
        double sum = 0.0;
        for (int k = 0; k < 3; k++) {
            v[i][k] = r->vertex[r->triangle[triangle][i]][k] - origin[k];
            sum += fabs(v[i][k]);
        }
        size = sum > size ? sum : size;
    }
    for (int i = 0; i < 3; i++) {
        const double *a = v[i], *b = v[(i + 1) % 3];
        side[i] = dir[0] * (a[1] * b[2] - a[2] * b[1]) + dir[1] * (a[2] * b[0] - a[0] * b[2]) +
                  dir[2] * (a[0] * b[1] - a[1] * b[0]);
    }
    double blur = 16.0 * 0x1p-53 * size * size;
    int plus = side[0] > blur || side[1] > blur || side[2] > blur;
    int minus = side[0] < -blur || side[1] < -blur || side[2] < -blur;
    return plus && minus;
}

static void try_triangle(const struct reference *r, uint32_t triangle, const double origin[3], const double dir[3],
                         struct reference_hit *best)
{
    if (surely_misses(r, triangle, origin, dir)) return;
    struct view v;
    ext d[3] = {dir[0], dir[1], dir[2]}, e1[3], e2[3], n[3];
    look(r, triangle, origin, d, &v);
    int plus = v.side[0] > 0 || v.side[1] > 0 || v.side[2] > 0;
    int minus = v.side[0] < 0 || v.side[1] < 0 || v.side[2] < 0;
    if (plus == minus) return; /* beside it, or within its plane */
    for (int k = 0; k < 3; k++) {
        e1[k] = v.corner[1][k] - v.corner[0][k];
        e2[k] = v.corner[2][k] - v.corner[0][k];
    }
    cross(e1, e2, n);
    ext range = dot(n, v.corner[0]) / dot(n, d);
    if (!(range >= 0)) return;
    if (!isnan(best->range_m) && !(range < best->range_m)) return;
    best->range_m = range;
    best->triangle = triangle;
}

/* ---- the grid */

/* Calls `add` for each cell that the widened triangle touches. */
static void each_cell(struct reference *r, uint32_t triangle,
                      void (*add)(struct reference *r, uint32_t cell, uint32_t tri))
{
    int32_t lo[3], hi[3];
    double e1[3], e2[3], n[3], reach = 0.0;
    const uint32_t *t = r->triangle[triangle];
    for (int k = 0; k < 3; k++) {
        double a = r->vertex[t[0]][k], b = r->vertex[t[1]][k], c = r->vertex[t[2]][k];
        double margin = 1e-6 * r->cell_m[k];
        lo[k] = (int32_t)floor((fmin(a, fmin(b, c)) - margin - r->min_m[k]) / r->cell_m[k]);
        hi[k] = (int32_t)floor((fmax(a, fmax(b, c)) + margin - r->min_m[k]) / r->cell_m[k]);
        lo[k] = lo[k] < 0 ? 0 : lo[k];
        hi[k] = hi[k] >= r->cells[k] ? r->cells[k] - 1 : hi[k];
        e1[k] = b - a;
        e2[k] = c - a;
    }
    for (int k = 0; k < 3; k++) {
        n[k] = e1[(k + 1) % 3] * e2[(k + 2) % 3] - e1[(k + 2) % 3] * e2[(k + 1) % 3];
        reach += fabs(n[k]) * (0.5 + 1e-3) * r->cell_m[k];
    }
    for (int32_t z = lo[2]; z <= hi[2]; z++)
        for (int32_t y = lo[1]; y <= hi[1]; y++)
            for (int32_t x = lo[0]; x <= hi[0]; x++) {
                const int32_t at[3] = {x, y, z};
                double off = 0.0;
                for (int k = 0; k < 3; k++)
                    off += n[k] * (r->min_m[k] + (at[k] + 0.5) * r->cell_m[k] - r->vertex[t[0]][k]);
                if (fabs(off) <= reach) add(r, (uint32_t)((z * r->cells[1] + y) * r->cells[0] + x), triangle);
            }
}

static void count(struct reference *r, uint32_t cell, uint32_t triangle)
{
    (void)triangle;
    r->start[cell + 1]++;
}

static void put(struct reference *r, uint32_t cell, uint32_t triangle)
{
    r->list[r->start[cell]++] = triangle;
}

/* Makes about two cells per triangle, as cubic as whole numbers allow. */
static uint32_t lay_out(struct reference *r)
{
    double max_m[3], extent = 0.0, volume = 1.0;
    for (int k = 0; k < 3; k++) {
        r->min_m[k] = INFINITY;
        max_m[k] = -INFINITY;
    }
    for (uint32_t i = 0; i < 3 * r->n_triangles; i++)
        for (int k = 0; k < 3; k++) {
            double x = r->vertex[r->triangle[i / 3][i % 3]][k];
            r->min_m[k] = fmin(r->min_m[k], x);
            max_m[k] = fmax(max_m[k], x);
        }
    for (int k = 0; k < 3; k++)
        extent = fmax(extent, max_m[k] - r->min_m[k]);
    for (int k = 0; k < 3; k++) {
        double pad = 1e-3 * extent; /* nothing lies on the grid's border */
        r->min_m[k] -= pad;
        max_m[k] += pad;
        volume *= max_m[k] - r->min_m[k];
    }
    double size = cbrt(volume / (2.0 * r->n_triangles));
    for (int k = 0; k < 3; k++) {
        double cells = ceil((max_m[k] - r->min_m[k]) / size);
        r->cells[k] = cells > 200.0 ? 200 : (int32_t)cells;
        r->cell_m[k] = (max_m[k] - r->min_m[k]) / r->cells[k];
    }
    return (uint32_t)(r->cells[0] * r->cells[1] * r->cells[2]);
}

struct reference *reference_create(const double (*vertex_m)[3], const uint32_t (*triangle)[3], uint32_t n_triangles)
{
    struct reference *r = calloc(1, sizeof *r);
    if (r == NULL) return NULL;
    r->vertex = vertex_m;
    r->triangle = triangle;
    r->n_triangles = n_triangles;
    uint32_t cells = lay_out(r);
    r->start = calloc(cells + 2, sizeof *r->start);
    if (r->start != NULL) {
        for (uint32_t i = 0; i < n_triangles; i++)
            each_cell(r, i, count);
        for (uint32_t c = 0; c < cells; c++)
            r->start[c + 1] += r->start[c];
        r->list = malloc((r->start[cells] + 1) * sizeof *r->list);
    }
    if (r->list == NULL) {
        reference_free(r);
        return NULL;
    }
    for (uint32_t i = 0; i < n_triangles; i++)
        each_cell(r, i, put);
    for (uint32_t c = cells; c > 0; c--) /* each start has moved on to its end */
        r->start[c] = r->start[c - 1];
    r->start[0] = 0;
    return r;
}

void reference_free(struct reference *r)
{
    if (r == NULL) return;
    free(r->start);
    free(r->list);
    free(r);
}

/* This is the state of the walk: the cell, and the ranges at which the ray leaves it along each axis. */
struct walk {
    int32_t at[3], step[3];
    double leave_m[3], cell_along_m[3];
};

static int begin_walk(const struct reference *r, const double origin[3], const double dir[3], struct walk *w)
{
    double enter = 0.0, leave = INFINITY;
    for (int k = 0; k < 3; k++) {
        double lo = r->min_m[k] - origin[k], hi = lo + r->cells[k] * r->cell_m[k];
        if (dir[k] == 0.0 && (lo > 0.0 || hi < 0.0)) return 0;
        if (dir[k] == 0.0) continue;
        double a = lo / dir[k], b = hi / dir[k];
        enter = fmax(enter, fmin(a, b));
        leave = fmin(leave, fmax(a, b));
    }
    if (enter > leave) return 0;
    for (int k = 0; k < 3; k++) {
        double from_m = r->min_m[k] - origin[k];
        int32_t at = (int32_t)floor((enter * dir[k] - from_m) / r->cell_m[k]);
        w->at[k] = at < 0 ? 0 : at >= r->cells[k] ? r->cells[k] - 1 : at;
        w->step[k] = dir[k] < 0.0 ? -1 : 1;
        w->cell_along_m[k] = dir[k] != 0.0 ? fabs(r->cell_m[k] / dir[k]) : INFINITY;
        double wall_m = from_m + (w->at[k] + (dir[k] > 0.0)) * r->cell_m[k];
        w->leave_m[k] = dir[k] != 0.0 ? wall_m / dir[k] : INFINITY;
    }
    return 1;
}

struct reference_hit reference_cast(const struct reference *r, const double origin_m[3], const double dir[3])
{
    struct reference_hit best = {NAN, REFERENCE_NONE};
    struct walk w;
    if (!begin_walk(r, origin_m, dir, &w)) return best;
    for (;;) {
        uint32_t cell = (uint32_t)((w.at[2] * r->cells[1] + w.at[1]) * r->cells[0] + w.at[0]);
        for (uint32_t i = r->start[cell]; i < r->start[cell + 1]; i++)
            try_triangle(r, r->list[i], origin_m, dir, &best);
        int k = w.leave_m[0] <= w.leave_m[1] ? 0 : 1;
        k = w.leave_m[2] < w.leave_m[k] ? 2 : k;
        if (best.range_m <= (ext)w.leave_m[k]) return best;
        w.at[k] += w.step[k];
        if (w.at[k] < 0 || w.at[k] >= r->cells[k]) return best;
        w.leave_m[k] += w.cell_along_m[k];
    }
}

struct reference_hit reference_brute(const struct reference *r, const double origin_m[3], const double dir[3])
{
    struct reference_hit best = {NAN, REFERENCE_NONE};
    for (uint32_t i = 0; i < r->n_triangles; i++)
        try_triangle(r, i, origin_m, dir, &best);
    return best;
}

/* ---- judging */

double reference_error(const struct reference_hit *truth, double range_m)
{
    if (truth->triangle == REFERENCE_NONE) return isnan(range_m) ? 0.0 : INFINITY;
    return isnan(range_m) ? INFINITY : (double)fabsl(truth->range_m - (ext)range_m);
}

/* Writes by how much the ray passes outside of the triangle (negative: inside), and how finely double precision can
 * tell that. */
static ext gap_of(const struct view *v, ext *blur_m)
{
    ext sum = v->side[0] + v->side[1] + v->side[2], gap = -INFINITY, far2 = 0;
    for (int i = 0; i < 3; i++) {
        const ext *a = v->corner[i], *b = v->corner[(i + 1) % 3];
        ext e[3] = {b[0] - a[0], b[1] - a[1], b[2] - a[2]};
        ext outside = (sum < 0 ? v->side[i] : -v->side[i]) / sqrtl(dot(e, e));
        gap = outside > gap ? outside : gap;
        far2 = dot(a, a) > far2 ? dot(a, a) : far2;
    }
    *blur_m = 16.0L * 0x1p-53L * sqrtl(far2);
    return gap;
}

int reference_is_undecidable(const struct reference *r, const double origin_m[3], const double dir[3],
                             const struct reference_hit *truth, double range_m)
{
    const ext d[3] = {dir[0], dir[1], dir[2]};
    ext upto = truth->triangle == REFERENCE_NONE ? (ext)range_m : truth->range_m;
    if ((ext)range_m > upto) upto = range_m;
    for (uint32_t i = 0; i < r->n_triangles; i++) {
        struct view v;
        ext blur, nearest = INFINITY, farthest = -INFINITY;
        look(r, i, origin_m, d, &v);
        ext gap = gap_of(&v, &blur);
        if (fabsl(gap) > blur) continue;
        for (int c = 0; c < 3; c++) {
            ext along = dot(v.corner[c], d);
            nearest = along < nearest ? along : nearest;
            farthest = along > farthest ? along : farthest;
        }
        if (farthest >= 0 && nearest <= upto + 1e-6L) return 1;
    }
    return 0;
}

double reference_margin_m(const struct reference *r, const double origin_m[3], const double dir[3], uint32_t triangle)
{
    const ext d[3] = {dir[0], dir[1], dir[2]};
    struct view v;
    ext blur;
    look(r, triangle, origin_m, d, &v);
    return (double)fabsl(gap_of(&v, &blur));
}
