/* SPDX-License-Identifier: MIT */
/* The mesh of a scan's grid: surfaces that must close, and the edges of grids with gaps. */
#include <math.h>
#include <string.h>

#include "core/rng.h"
#include "tests/unit/scan_mesh_rig.h"

static const double PI = 3.14159265358979323846;

/* Adds the point where the direction meets the box from -2 -1 -1 to 3 2 1.5. */
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

/* A sphere of R rings and S steps has 2 + (R - 2) S points, two fans of S and (R - 3) S cells of two. The box is convex
 * and the head inside it, so all cells face the head. V - E + F = 2 for a sphere (Euler). */
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

/* Returns the volume within, by the divergence theorem. The volume is below that of the box, whose edges and corners
 * are cut off. Normals are inward, so the result is negative. */
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
    /* Cells are 5 degrees. The area cut off at an edge is below (cell / 2)^2 along 12 edges of at most 5 m. A cell on
     * the walls is at most 5 degrees * 4 m (slant 1.7) = 0.6 m wide. */
    assert_in_range((uint64_t)(-1000 * volume()), 1000 * 5 * 3 * 2.5 - 1000 * 12 * 5 * 0.09, 1000 * 5 * 3 * 2.5);
}

/* A ring of 36 columns and 5 rows is a tube: V - E + F = 0, and each edge of the two borders, of 36 edges each, is in
 * one face only. */
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

/* Two columns have only the one wall between them, even where the grid closes. */
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

/* Rows 0, 1, 2 go round the head. One of two columns lacks the last row: there is a cell of four points, and two more
 * of three, one of them across the turn's end. */
static void turns_close_beside_a_gap(void **state)
{
    (void)state;
    for (uint32_t short_one = 0; short_one < 2; short_one++) {
        begin();
        t.grid.rows_per_turn = 3;
        for (uint32_t column = 0; column < 2; column++) {
            add_column(column, 0);
            for (uint32_t row = 0; row < (column == short_one ? 2u : 3u); row++)
                add_point(row, cos(2 * PI * row / 3), column, sin(2 * PI * row / 3));
        }
        make(0);
        const struct edges edges = edges_of();
        assert_int_equal(t.faces.n_faces, 4);
        assert_edges_as_counted(&edges);
        assert_faces_the_head();
    }
}

/* Points are at random places of the grid. The counted edges are those of the faces, whatever is missing. There are no
 * faces without a direction: only by chance would a point lie in the plane of two others and the head. */
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

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_sphere_in_a_box_is_closed), cmocka_unit_test(the_sphere_has_the_boxs_volume),
        cmocka_unit_test(a_full_turn_closes),          cmocka_unit_test(two_columns_do_not_close),
        cmocka_unit_test(edges_of_a_ragged_grid),      cmocka_unit_test(turns_close_beside_a_gap),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
