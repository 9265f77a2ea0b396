/* SPDX-License-Identifier: MIT */
/* The mesh of a scan's grid: counts worked out by hand, surfaces that must close, points spread over them. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "core/rng.h"
#include "core/studio/scan_mesh.h"

enum { MAX_POINTS = 4096, MAX_COLUMNS = 128 };

static const double PI = 3.14159265358979323846;

/* A grid under construction, and what comes of it. */
static struct {
    double xyz[MAX_POINTS][3];
    uint32_t row[MAX_POINTS];
    struct scan_column column[MAX_COLUMNS];
    struct scan_grid grid;
    struct scan_faces faces;
    struct sh_err err;
} t;

static void begin(void)
{
    scan_faces_free(&t.faces);
    memset(&t.grid, 0, sizeof t.grid);
    t.grid.xyz_m = (const double(*)[3])t.xyz;
    t.grid.row = t.row;
    t.grid.column = t.column;
}

static void add_column(uint32_t line, int is_pole)
{
    t.column[t.grid.n_columns++] = (struct scan_column){line, t.grid.n_points, is_pole};
}

static void add_point(uint32_t row, double x, double y, double z)
{
    double *p = t.xyz[t.grid.n_points];
    t.row[t.grid.n_points++] = row;
    p[0] = x;
    p[1] = y;
    p[2] = z;
}

static void make(double long_edge)
{
    scan_faces_free(&t.faces);
    t.grid.long_edge = long_edge;
    if (scan_faces_make(&t.grid, &t.faces, NULL, &t.err) != SH_OK) fail_msg("%s", t.err.text);
}

static void assert_near(double got, double want, double tolerance)
{
    if (!(fabs(got - want) <= tolerance)) fail_msg("%.15g instead of %.15g", got, want);
}

/* ---- by another way: each face's edges into one list */

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

struct edges {
    uint64_t n, n_once, n_unlike; /* different; in one face alone; in more than two, or twice in one direction */
    double mean_m;
};

static struct edges edges_of(void)
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

/* 1e-12: a sum of thousands of lengths, each rounded to 1e-16. */
static void assert_edges_as_counted(const struct edges *edges)
{
    assert_int_equal(t.faces.n_edges, edges->n);
    assert_near(t.faces.mean_edge_m, edges->mean_m, 1e-12 * edges->mean_m);
}

static void assert_faces_the_head(void)
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

/* ---- a wall with a step, 10 m away: four columns and three rows 1 m apart, the last two columns 1 m further away
 *
 *   edges before the filter   8 along columns           of 1
 *                             6 + 3 across columns      of 1, and of root 2 at the step
 *                             4 + 2 diagonals           of root 2, and of root 3 at the step
 *   mean                      (14 + 7 root 2 + 2 root 3) / 23 = 1.18972 m
 *
 * All triangles have a diagonal: 8 of root 2 = 1.18870 means, 4 of root 3 = 1.45585 means. */
static void make_step(int mirrored)
{
    begin();
    for (uint32_t column = 0; column < 4; column++) {
        add_column(7 + column, 0);
        for (uint32_t row = 0; row < 3; row++)
            add_point(20 + row, mirrored ? -(double)column : column, column < 2 ? 10 : 11, row);
    }
}

static void a_wall_with_a_step(void **state)
{
    (void)state;
    static const struct {
        double factor;
        uint32_t n_faces;
    } expected[] = {{0, 12}, {1.46, 12}, {1.45, 8}, {1.2, 8}, {1.18, 0}};
    for (int mirrored = 0; mirrored < 2; mirrored++) {
        make_step(mirrored);
        for (size_t i = 0; i < sizeof expected / sizeof expected[0]; i++) {
            make(expected[i].factor);
            assert_int_equal(t.faces.n_faces, expected[i].n_faces);
            assert_int_equal(t.faces.n_long, 12 - expected[i].n_faces);
            assert_int_equal(t.faces.n_edges, 23);
            assert_near(t.faces.mean_edge_m, (14 + 7 * sqrt(2) + 2 * sqrt(3)) / 23, 1e-14);
            assert_faces_the_head();
        }
    }
}

static void cells_with_three_corners(void **state)
{
    (void)state;
    begin();
    for (uint32_t column = 0; column < 3; column++) {
        add_column(column, 0);
        for (uint32_t row = 0; row < 3; row++)
            if (row != 1 || column != 1) add_point(row, column, 5, row);
    }
    make(0);
    assert_int_equal(t.faces.n_faces, 4); /* a triangle in each cell, at its corner of the grid */
    assert_int_equal(t.faces.n_edges, 8 + 4);
    const struct edges edges = edges_of();
    assert_edges_as_counted(&edges);
    assert_faces_the_head();
}

/* Neither a line nor a row that is missing is bridged. */
static void gaps_stay_open(void **state)
{
    (void)state;
    begin();
    for (uint32_t column = 0; column < 4; column++) {
        add_column(column < 2 ? column : column + 1, 0);
        for (uint32_t row = 0; row < 5; row++)
            if (row != 2) add_point(row, column, 5, row);
    }
    make(0);
    assert_int_equal(t.faces.n_faces, 2 * 4); /* columns 0-1 and 2-3, rows 0-1 and 3-4 */
    const struct edges edges = edges_of();
    assert_edges_as_counted(&edges);
}

static void the_shorter_diagonal(void **state)
{
    (void)state;
    begin();
    add_column(0, 0);
    add_point(0, 0, 5, 0);
    add_point(1, 0, 5, 1);
    add_column(1, 0);
    add_point(0, 1, 5, 0);
    add_point(1, 2, 5, 2); /* far from the first point: the other two are joined */
    make(0);
    assert_int_equal(t.faces.n_faces, 2);
    for (uint32_t i = 0; i < 2; i++)
        for (int with = 0; with < 2; with++) {
            const uint32_t *f = t.faces.face[i], p = with ? 1 : 2;
            assert_true(f[0] == p || f[1] == p || f[2] == p);
        }
}

/* Where the head lies in the plane of a triangle, and where it has no area. */
static void what_faces_nowhere_is_counted(void **state)
{
    (void)state;
    begin();
    for (uint32_t column = 0; column < 3; column++) {
        add_column(column, 0);
        for (uint32_t row = 0; row < 2; row++)
            add_point(row, column < 2 ? column : 1, 2.0 + row, column < 2 ? 0 : -1); /* the first cell lies at z = 0 */
    }
    make(0);
    assert_int_equal(t.faces.n_flat, 2);
    assert_int_equal(t.faces.n_faces, 2);
    assert_faces_the_head();
    begin();
    for (uint32_t column = 0; column < 2; column++) {
        add_column(column, 0);
        add_point(0, 1, 1, 1);
        add_point(1, 1, 1, 1);
    }
    make(0);
    assert_int_equal(t.faces.n_flat, 2);
    assert_int_equal(t.faces.n_faces, 0);
}

/* ---- surfaces without an edge */

/* The first wall of a box from -2 -1 -1 to 3 2 1.5 in a direction. */
static void add_in_box(uint32_t row, double azimuth, double elevation)
{
    static const double low[3] = {-2, -1, -1}, high[3] = {3, 2, 1.5};
    const double d[3] = {cos(elevation) * sin(azimuth), cos(elevation) * cos(azimuth), sin(elevation)};
    double range = 100;
    for (int k = 0; k < 3; k++)
        if (d[k] != 0) range = fmin(range, (d[k] > 0 ? high[k] : low[k]) / d[k]);
    add_point(row, range * d[0], range * d[1], range * d[2]);
}

static void make_sphere(uint32_t rings, uint32_t steps)
{
    begin();
    t.grid.rows_per_turn = steps;
    for (uint32_t ring = 0; ring < rings; ring++) {
        const int is_pole = ring == 0 || ring == rings - 1;
        const double elevation = PI * ring / (rings - 1) - PI / 2;
        add_column(ring, is_pole);
        for (uint32_t step = 0; step < (is_pole ? 1 : steps); step++)
            add_in_box(step, 2 * PI * step / steps, elevation);
    }
    make(0);
}

/* A sphere of R rings and S steps: 2 + (R - 2) S points, two fans of S and (R - 3) S cells of two. The box is convex and the
 * head inside it: all cells face the head. V - E + F = 2 for a sphere (Euler). */
static void a_sphere_in_a_box_is_closed(void **state)
{
    (void)state;
    static const uint32_t size[][2] = {{5, 8}, {19, 36}, {37, 72}, {3, 3}};
    for (size_t i = 0; i < sizeof size / sizeof size[0]; i++) {
        const uint32_t rings = size[i][0], steps = size[i][1];
        make_sphere(rings, steps);
        assert_int_equal(t.grid.n_points, 2 + (rings - 2) * steps);
        assert_int_equal(t.faces.n_faces, 2 * (rings - 2) * steps);
        assert_int_equal(t.faces.n_flat, 0);
        const struct edges edges = edges_of();
        assert_edges_as_counted(&edges);
        assert_int_equal(edges.n_once, 0);
        assert_int_equal(edges.n_unlike, 0);
        assert_int_equal((int64_t)t.grid.n_points - (int64_t)edges.n + (int64_t)t.faces.n_faces, 2);
        assert_faces_the_head();
    }
}

/* The volume within, by the divergence theorem, is below that of the box (whose edges and corners are cut off) and comes
 * to it: normals are inward, so that it is negative. */
static double volume(void)
{
    double sum = 0;
    for (uint32_t i = 0; i < t.faces.n_faces; i++) {
        const double *a = t.xyz[t.faces.face[i][0]], *b = t.xyz[t.faces.face[i][1]], *c = t.xyz[t.faces.face[i][2]];
        sum += a[0] * (b[1] * c[2] - b[2] * c[1]) + a[1] * (b[2] * c[0] - b[0] * c[2]) +
               a[2] * (b[0] * c[1] - b[1] * c[0]);
    }
    return sum / 6;
}

static void the_sphere_has_the_boxs_volume(void **state)
{
    (void)state;
    make_sphere(37, 72);
    /* cells of 5 degrees: what is cut off at an edge is below (cell / 2)^2 of area along 12 edges of at most 5 m, and a
     * cell on the walls is at most 5 degrees * 4 m (slant 1.7) = 0.6 m wide */
    assert_in_range((uint64_t)(-1000 * volume()), 1000 * 5 * 3 * 2.5 - 1000 * 12 * 5 * 0.09, 1000 * 5 * 3 * 2.5);
}

/* A ring of 36 columns and 5 rows, a tube: V - E + F = 0, the two borders of 36 edges each are in one face. */
static void a_full_turn_closes(void **state)
{
    (void)state;
    for (int closes = 0; closes < 2; closes++) {
        begin();
        t.grid.closes = closes;
        for (uint32_t column = 0; column < 36; column++) {
            add_column(column, 0);
            for (uint32_t row = 0; row < 5; row++)
                add_in_box(row, 2 * PI * column / 36, 0.1 * row);
        }
        make(0);
        const struct edges edges = edges_of();
        assert_edges_as_counted(&edges);
        assert_int_equal(t.faces.n_faces, (35 + (uint32_t)closes) * 4 * 2);
        assert_int_equal(edges.n_once, closes ? 2 * 36 : 2 * 35 + 2 * 4);
        assert_int_equal(edges.n_unlike, 0);
        assert_int_equal(t.grid.n_points - edges.n + t.faces.n_faces, closes ? 0 : 1);
        assert_faces_the_head();
    }
}

/* Two columns have nothing between them but the one wall, also where the grid closes. */
static void two_columns_do_not_close(void **state)
{
    (void)state;
    begin();
    t.grid.closes = 1;
    for (uint32_t column = 0; column < 2; column++) {
        add_column(column, 0);
        for (uint32_t row = 0; row < 5; row++)
            add_in_box(row, 2 * PI * column / 36, 0.1 * row);
    }
    make(0);
    assert_int_equal(t.faces.n_faces, 4 * 2);
}

/* Points at random places of the grid: the edges are those that the faces have, whatever is missing. Faces without a
 * direction can't be among them: no point lies in the plane of two others and the head but by chance. */
static void edges_of_a_ragged_grid(void **state)
{
    (void)state;
    const uint64_t key = rng_key(3, RNG_SCENE);
    for (uint32_t share = 1; share < 8; share++) {
        begin();
        t.grid.rows_per_turn = 20;
        for (uint32_t column = 0; column < 30; column++) {
            add_column(column, 0);
            for (uint32_t row = 0; row < 20; row++)
                if (rng_u64(key, 1000 * share + 20 * column + row) % 8 < share)
                    add_in_box(row, 2 * PI * row / 20, 0.1 * column - 1.45);
        }
        make(0);
        const struct edges edges = edges_of();
        assert_int_equal(t.faces.n_flat, 0);
        if (t.faces.n_faces > 0) assert_edges_as_counted(&edges);
        assert_int_equal(edges.n_unlike, 0);
        assert_faces_the_head();
    }
}

/* ---- normals, loose points */

static void normals_are_those_of_the_walls(void **state)
{
    (void)state;
    float normal[12][3];
    make_step(0);
    make(1.2); /* two walls apart */
    scan_normals(t.grid.xyz_m, t.grid.n_points, (const uint32_t(*)[3])t.faces.face, t.faces.n_faces, normal);
    for (int i = 0; i < 12; i++) {
        assert_true(normal[i][0] == 0 && normal[i][1] == -1 && normal[i][2] == 0);
    }
    make(1.18);
    scan_normals(t.grid.xyz_m, t.grid.n_points, (const uint32_t(*)[3])t.faces.face, t.faces.n_faces, normal);
    assert_true(normal[0][0] == 0 && normal[0][1] == 0 && normal[0][2] == 0);
}

/* A point of a floor and a wall three times as large: the mean of their normals, by their areas. */
static void normals_at_a_corner(void **state)
{
    (void)state;
    static const double p[4][3] = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 3}};
    static const uint32_t face[2][3] = {{0, 1, 2}, {0, 3, 1}};
    float n[4][3];
    scan_normals(p, 4, face, 2, n);
    const double length = sqrt(10.0);
    for (uint32_t i = 0; i < 2; i++)
        assert_true(fabs((double)n[i][1] - 3.0 / length) < 1e-6 && fabs((double)n[i][2] - 1.0 / length) < 1e-6);
    assert_true(n[2][2] == 1 && n[3][1] == 1);
}

static void loose_points_are_left_out(void **state)
{
    (void)state;
    uint32_t to[9];
    begin();
    for (uint32_t column = 0; column < 3; column++) {
        add_column(column, 0);
        for (uint32_t row = 0; row < 3; row++)
            add_point(row, column, column == 2 ? 50 : 5, row);
    }
    /* the two cells to the third column, 45 m further away, are left out: the mean is (9 + 2 root 2 + 3 * 45.01 + 2 *
     * 45.02) / 16 = 14.8 m */
    make(2.9);
    assert_int_equal(t.faces.n_long, 4);
    assert_int_equal(t.faces.n_faces, 4);
    assert_int_equal(scan_drop_loose(9, t.faces.face, t.faces.n_faces, to), 6);
    for (uint32_t i = 0; i < 9; i++)
        assert_int_equal(to[i], i < 6 ? i : SCAN_MESH_NONE);
    for (uint32_t i = 0; i < 4; i++)
        for (int k = 0; k < 3; k++)
            assert_true(t.faces.face[i][k] < 6);
}

/* ---- points spread over the mesh */

static void sparse_counts_by_hand(void **state)
{
    (void)state;
    struct scan_sampler s;
    make_step(0);
    make(1.2); /* two walls of 1 x 2 m */
    assert_int_equal(
        scan_sampler_start(&s, t.grid.xyz_m, (const uint32_t(*)[3])t.faces.face, t.faces.n_faces, 5, &t.err), SH_OK);
    assert_near(s.area_m2, 4, 1e-14);
    assert_true(scan_sampler_count(&s, 100) == 400);
    assert_true(scan_sampler_count(&s, 0.62) == 2);
    assert_true(scan_sampler_count(&s, 0.63) == 3);
    scan_sampler_free(&s);
    make(0); /* with the slanted strip of root 2 x 2 m between them */
    assert_int_equal(
        scan_sampler_start(&s, t.grid.xyz_m, (const uint32_t(*)[3])t.faces.face, t.faces.n_faces, 5, &t.err), SH_OK);
    assert_near(s.area_m2, 4 + 2 * sqrt(2), 1e-14);
    assert_true(scan_sampler_count(&s, 1000) == 6828);
    scan_sampler_free(&s);
}

/* 32 cells of 1/4 x 1/4 m on each of the two walls. With 6400 points 100 a cell are expected. Chi-square has 63 degrees of
 * freedom: it is above 126.1 for 4.5 in a million seeds, and below 25 for 5 in a million (Wilson and Hilferty 1931). The
 * seed is fixed, so that the test does not vary. */
static void sparse_points_are_even(void **state)
{
    (void)state;
    enum { N = 6400, CELLS = 64 };
    struct scan_sampler s, other;
    unsigned n[CELLS] = {0}, n_same = 0;
    double chi2 = 0;
    make_step(0);
    make(1.2);
    const uint32_t(*face)[3] = (const uint32_t(*)[3])t.faces.face;
    assert_int_equal(scan_sampler_start(&s, t.grid.xyz_m, face, t.faces.n_faces, rng_key(1, RNG_SPARSE), &t.err), 0);
    assert_int_equal(scan_sampler_start(&other, t.grid.xyz_m, face, t.faces.n_faces, rng_key(2, RNG_SPARSE), &t.err),
                     0);
    for (uint64_t k = 0; k < N; k++) {
        uint32_t at, again;
        double w[3], w2[3], p[3] = {0};
        scan_sampler_point(&s, k, &at, w);
        scan_sampler_point(&s, k, &again, w2);
        assert_true(at == again && memcmp(w, w2, sizeof w) == 0);
        scan_sampler_point(&other, k, &again, w2);
        n_same += at == again && memcmp(w, w2, sizeof w) == 0;
        for (int i = 0; i < 3; i++) {
            assert_true(w[i] >= -1e-16 && w[i] <= 1);
            for (int d = 0; d < 3; d++)
                p[d] += w[i] * t.xyz[face[at][i]][d];
        }
        const int far = p[1] > 10.5;
        const double x = p[0] - 2 * far;
        assert_near(p[1], far ? 11 : 10, 1e-14);
        assert_true(x >= -1e-15 && x <= 1 + 1e-15 && p[2] >= -1e-15 && p[2] <= 2 + 1e-15);
        n[far * 32 + (int)fmin(x * 4, 3) * 8 + (int)fmin(p[2] * 4, 7)]++;
    }
    for (int i = 0; i < CELLS; i++)
        chi2 += (n[i] - 100.0) * (n[i] - 100.0) / 100.0;
    if (!(chi2 < 126.1 && chi2 > 25)) fail_msg("chi-square %.1f of 63 degrees of freedom", chi2);
    assert_int_equal(n_same, 0);
    scan_sampler_free(&s);
    scan_sampler_free(&other);
}

static void nothing_gives_nothing(void **state)
{
    (void)state;
    struct scan_sampler s;
    begin();
    make(3);
    assert_int_equal(t.faces.n_faces, 0);
    assert_int_equal(scan_sampler_start(&s, t.grid.xyz_m, NULL, 0, 1, &t.err), SH_OK);
    assert_true(scan_sampler_count(&s, 1e9) == 0);
    scan_sampler_free(&s);
    add_column(0, 0);
    add_point(0, 1, 1, 1);
    make(3);
    assert_int_equal(t.faces.n_faces, 0);
    begin();
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_wall_with_a_step),
        cmocka_unit_test(cells_with_three_corners),
        cmocka_unit_test(gaps_stay_open),
        cmocka_unit_test(the_shorter_diagonal),
        cmocka_unit_test(what_faces_nowhere_is_counted),
        cmocka_unit_test(a_sphere_in_a_box_is_closed),
        cmocka_unit_test(the_sphere_has_the_boxs_volume),
        cmocka_unit_test(a_full_turn_closes),
        cmocka_unit_test(two_columns_do_not_close),
        cmocka_unit_test(edges_of_a_ragged_grid),
        cmocka_unit_test(normals_are_those_of_the_walls),
        cmocka_unit_test(normals_at_a_corner),
        cmocka_unit_test(loose_points_are_left_out),
        cmocka_unit_test(sparse_counts_by_hand),
        cmocka_unit_test(sparse_points_are_even),
        cmocka_unit_test(nothing_gives_nothing),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
