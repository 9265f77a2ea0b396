/* SPDX-License-Identifier: MIT */
/* The mesh of a scan's grid: counts worked out by hand, normals, points spread over it. */
#include <math.h>
#include <string.h>

#include "core/rng.h"
#include "tests/unit/scan_mesh_rig.h"

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

/* A missing line or row is not bridged. */
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

/* The head lies in the plane of a triangle, or the triangle has no area. */
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

/* A point of a floor and of a wall three times as large has the mean of their normals, weighted by area. */
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
    /* The two cells to the third column, 45 m further away, are left out: the mean is (9 + 2 root 2 + 3 * 45.01 + 2 *
     * 45.02) / 16 = 14.8 m. */
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

/* There are 32 cells of 1/4 x 1/4 m on each of the two walls. With 6400 points 100 a cell are expected. Chi-square has
 * 63 degrees of freedom: it is above 126.1 for 4.5 in a million seeds, and below 25 for 5 in a million (Wilson and
 * Hilferty 1931). The seed is fixed, so that the test does not vary. */
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
        cmocka_unit_test(normals_are_those_of_the_walls),
        cmocka_unit_test(normals_at_a_corner),
        cmocka_unit_test(loose_points_are_left_out),
        cmocka_unit_test(sparse_counts_by_hand),
        cmocka_unit_test(sparse_points_are_even),
        cmocka_unit_test(nothing_gives_nothing),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
