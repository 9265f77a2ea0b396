/* SPDX-License-Identifier: MIT */
#include "tests/unit/scan_mesh_rig.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

struct mesh_grid t;

void begin(void)
{
    scan_faces_free(&t.faces);
    memset(&t.grid, 0, sizeof t.grid);
    t.grid.xyz_m = (const double(*)[3])t.xyz;
    t.grid.row = t.row;
    t.grid.column = t.column;
}

void add_column(uint32_t line, int is_pole)
{
    t.column[t.grid.n_columns++] = (struct scan_column){line, t.grid.n_points, is_pole};
}

void add_point(uint32_t row, double x, double y, double z)
{
    double *p = t.xyz[t.grid.n_points];
    t.row[t.grid.n_points++] = row;
    p[0] = x;
    p[1] = y;
    p[2] = z;
}

void make(double long_edge)
{
    scan_faces_free(&t.faces);
    t.grid.long_edge = long_edge;
    if (scan_faces_make(&t.grid, &t.faces, NULL, &t.err) != SH_OK) fail_msg("%s", t.err.text);
}

void assert_near(double got, double want, double tolerance)
{
    if (!(fabs(got - want) <= tolerance)) fail_msg("%.15g instead of %.15g", got, want);
}

struct edge {
    uint32_t low, high;
    int up; /* as the face goes along it: from low to high */
};

static int by_ends(const void *a, const void *b)
{
    const struct edge *p = a, *q = b;
    if (p->low != q->low) return p->low < q->low ? -1 : 1;
    return p->high != q->high ? (p->high < q->high ? -1 : 1) : p->up - q->up;
}

struct edges edges_of(void)
{
    struct edges sum = {0};
    const size_t n = 3 * (size_t)t.faces.n_faces;
    struct edge *edge = malloc((n + 1) * sizeof *edge);
    assert_non_null(edge);
    for (size_t i = 0; i < n; i++) {
        const uint32_t p = t.faces.face[i / 3][i % 3], q = t.faces.face[i / 3][(i + 1) % 3];
        edge[i] = (struct edge){p < q ? p : q, p < q ? q : p, p < q};
    }
    qsort(edge, n, sizeof *edge, by_ends);
    for (size_t i = 0, end; i < n; i = end) {
        const double *a = t.xyz[edge[i].low], *b = t.xyz[edge[i].high];
        for (end = i + 1; end < n && edge[end].low == edge[i].low && edge[end].high == edge[i].high;)
            end++;
        sum.n++;
        sum.n_once += end - i == 1;
        sum.n_unlike += end - i > 2 || (end - i == 2 && edge[i].up == edge[i + 1].up);
        sum.mean_m += sqrt(pow(a[0] - b[0], 2) + pow(a[1] - b[1], 2) + pow(a[2] - b[2], 2));
    }
    sum.mean_m /= (double)sum.n;
    free(edge);
    return sum;
}

void assert_edges_as_counted(const struct edges *edges)
{
    assert_int_equal(t.faces.n_edges, edges->n);
    /* The mean is a sum of thousands of lengths, each rounded to 1e-16. */
    assert_near(t.faces.mean_edge_m, edges->mean_m, 1e-12 * edges->mean_m);
}

void assert_faces_the_head(void)
{
    for (uint32_t i = 0; i < t.faces.n_faces; i++) {
        const double *a = t.xyz[t.faces.face[i][0]], *b = t.xyz[t.faces.face[i][1]], *c = t.xyz[t.faces.face[i][2]];
        double u[3], v[3], w[3];
        for (int k = 0; k < 3; k++) {
            u[k] = b[k] - a[k];
            v[k] = c[k] - a[k];
            w[k] = t.grid.head_m[k] - a[k];
        }
        assert_true((u[1] * v[2] - u[2] * v[1]) * w[0] + (u[2] * v[0] - u[0] * v[2]) * w[1] +
                        (u[0] * v[1] - u[1] * v[0]) * w[2] >
                    0);
    }
}
