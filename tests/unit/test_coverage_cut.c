/* SPDX-License-Identifier: MIT */
/* Triangles in pieces: their areas add up, none is too large, and a point is found in the piece that holds it. And sums
 * over cells. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <cmocka.h>

#include "core/studio/coverage/cut.h"
#include "core/studio/coverage/inside.h"
#include "core/rng.h"
#include "core/vec3.h"

/* The triangles are a wall, a flat and a steep needle, one that is a single piece, and an equal-sided one. The
 * last two: one has a right angle at the base's end to double precision, the other has coordinates of UTM. */
static const double CASES[][3][3] = {
    {{0, 0, 0}, {10.2, 0, 0}, {10.2, 0, 4.24}},
    {{0, 0, 0}, {10, 0, 0}, {4, 0.01, 0.02}},
    {{0, 0, 0}, {10, 0, 0}, {9.9999, 0.3, 0}},
    {{0, 0, 0}, {0.1, 0, 0}, {0, 0.2, 0.1}},
    {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}},
    {{0, 0, 0}, {5, 0, 0}, {5, 1e-9, 1}},
    {{458835.1, 5438800.7, 110.2}, {458839.9, 5438801.3, 110.9}, {458836.2, 5438805.5, 112.4}},
};
enum { N_CASES = sizeof CASES / sizeof CASES[0] };

static double area_of(int n, const double corner[][3], double normal[3])
{
    for (int k = 0; k < 3; k++)
        normal[k] = 0.0;
    for (int i = 2; i < n; i++) {
        double a[3], b[3], c[3];
        vec3_sub(corner[i - 1], corner[0], a);
        vec3_sub(corner[i], corner[0], b);
        vec3_cross(a, b, c);
        vec3_add(normal, c, normal);
    }
    return 0.5 * vec3_length(normal);
}

/* Coordinates of UTM are good to 1e-9 m, so areas of pieces of 1 cm or more are good to a part in 1e6. */
static void check_pieces(const double corner[3][3], double size_m)
{
    struct cut cut;
    double normal[3], piece_normal[3], at[4][3], shares = 0.0, count = 0.0;
    const double area_m2 = area_of(3, corner, normal);
    cut_set_up(corner, size_m, &cut);
    for (uint32_t k = 0; k < cut_columns(&cut); k++) {
        const uint32_t rows = cut_rows(&cut, k);
        count += rows;
        for (uint32_t r = 0; r < rows; r++) {
            const int n = cut_corners(&cut, corner, k, r, r + 1, at);
            const double share = area_of(n, (const double(*)[3])at, piece_normal) / area_m2;
            shares += cut_share(&cut, k);
            if (!(fabs(share - cut_share(&cut, k)) <= 1e-6 * cut_share(&cut, k) + 1e-13))
                fail_msg("size %g, column %u, row %u: %.17g of the area, and it should be %.17g", size_m, k, r, share,
                         cut_share(&cut, k));
            assert_true(vec3_dot(normal, piece_normal) > 0.0);
            for (int i = 0; i < n; i++)
                for (int j = 0; j < i; j++)
                    assert_true(vec3_distance(at[i], at[j]) <= size_m * (1.0 + 1e-9) + 1e-8);
        }
    }
    assert_true(count == cut_count(corner, size_m));
    /* Each share is a ratio with three roundings; some thousand of them are added. */
    if (!(fabs(shares - 1.0) <= 1e-12)) fail_msg("size %g: %.17g of the area", size_m, shares);
}

static void test_partition(void **state)
{
    (void)state;
    static const double sizes_m[] = {0.05, 0.25, 1.0, 3.7, 100.0};
    for (size_t i = 0; i < N_CASES; i++)
        for (size_t k = 0; k < sizeof sizes_m / sizeof sizes_m[0]; k++)
            check_pieces(CASES[i], sizes_m[k]);
}

/* Returns whether the polygon holds the point, to slack_m: the point is left of all its edges. */
static int holds(int n, const double corner[4][3], const double normal[3], const double p[3], double slack_m)
{
    for (int i = 0; i < n; i++) {
        double edge[3], to[3], across[3];
        vec3_sub(corner[(i + 1) % n], corner[i], edge);
        vec3_sub(p, corner[i], to);
        vec3_cross(edge, to, across);
        if (vec3_dot(across, normal) < -slack_m * vec3_length(edge) * vec3_length(normal)) return 0;
    }
    return 1;
}

static void test_points_are_found(void **state)
{
    (void)state;
    const uint64_t key = rng_key(7, RNG_SCENE);
    for (size_t i = 0; i < N_CASES; i++)
        for (uint64_t k = 0; k < 2000; k++) {
            struct cut cut;
            uint32_t column, row;
            double w[3], p[3], at[4][3], normal[3];
            for (uint64_t c = 0; c < 3; c++)
                w[c] = 1e-12 - log(((double)(rng_u64(key, 3 * k + c) >> 11) + 1.0) * 0x1p-53);
            for (int a = 0; a < 3; a++)
                p[a] = (w[0] * CASES[i][0][a] + w[1] * CASES[i][1][a] + w[2] * CASES[i][2][a]) / (w[0] + w[1] + w[2]);
            area_of(3, CASES[i], normal);
            cut_set_up(CASES[i], 0.25, &cut);
            cut_find(&cut, w, &column, &row);
            assert_true(column < cut_columns(&cut) && row < cut_rows(&cut, column));
            const int n = cut_corners(&cut, CASES[i], column, row, row + 1, at);
            if (!holds(n, (const double(*)[3])at, normal, p, 1e-8))
                fail_msg("case %zu: %.9f %.9f %.9f is not in column %u, row %u", i, p[0], p[1], p[2], column, row);
        }
}

/* Corners are tried, and points that rounding leaves outside. */
static void test_border(void **state)
{
    (void)state;
    static const double weights[][3] = {{1, 0, 0},      {0, 1, 0},      {0, 0, 1},
                                        {1, -1e-12, 0}, {0, 1, -1e-12}, {-1e-12, 0, 1}};
    for (size_t i = 0; i < N_CASES; i++)
        for (size_t k = 0; k < sizeof weights / sizeof weights[0]; k++) {
            struct cut cut;
            uint32_t column, row;
            cut_set_up(CASES[i], 0.25, &cut);
            cut_find(&cut, weights[k], &column, &row);
            assert_true(column < cut_columns(&cut) && row < cut_rows(&cut, column));
        }
}

/* A needle of 10 m by 1 mm has one row. Columns are 0.25 / sqrt(5) m wide; each leg's number is rounded up. */
static void test_needle(void **state)
{
    (void)state;
    static const double needle[3][3] = {{0, 0, 0}, {10, 0, 0}, {3, 0, 0.001}};
    assert_true(cut_count(needle, 0.25) == ceil(3.0 * sqrt(5.0) / 0.25) + ceil(7.0 * sqrt(5.0) / 0.25));
}

/* Sums over cells that are put together by hand: areas by the number of stations that see them, by surface, by station.
 * Spreads are weighted by area, of seen cells only. */
static void test_sums(void **state)
{
    (void)state;
    struct cell cell[5] = {{.area_m2 = 8.0, .pulses = 10, .stations = 1, .first_station = 2, .label = 0},
                           {.area_m2 = 1.0, .pulses = 40, .stations = 2, .first_station = 1, .label = 0},
                           {.area_m2 = 2.0, .pulses = 40, .stations = 1, .first_station = 1, .label = 1},
                           {.area_m2 = 4.0, .label = 1},
                           {.area_m2 = 1.0, .pulses = 5, .stations = 3, .first_station = 1, .label = 1}};
    static const double range_m[5] = {1.0, 2.0, 3.0, 0.0, 4.0};
    const struct scene scene = {.n_triangles = 9, .n_surfaces = 2};
    const struct coverage c = {.scene = &scene, .n_cells = 5, .n_stations = 3, .cell = cell};
    struct coverage_of_label label[2];
    struct coverage_sums sums;
    struct sh_err err;
    double alone_m2[3];
    for (int i = 0; i < 5; i++) {
        if (cell[i].stations > 0) cell[i].nearness = coverage_bits(1.0 / range_m[i]);
        if (cell[i].stations > 0) cell[i].cosine = coverage_bits(0.5);
    }
    assert_int_equal(coverage_sum(&c, &sums, &err), SH_OK);
    assert_true(sums.area_m2 == 16.0 && sums.none_m2 == 4.0 && sums.one_m2 == 10.0 && sums.several_m2 == 2.0);
    /* 12 m2 are seen: 8, 1, 2 and 1 m2 with 1.25, 40, 20 and 5 pulses a m2; floats are good to 1e-7 */
    assert_true(fabs(sums.density_1_m2.mean - 95.0 / 12.0) < 1e-12);
    assert_true(sums.density_1_m2.p05 == 1.25 && sums.density_1_m2.p50 == 1.25 && sums.density_1_m2.p95 == 40.0);
    assert_true(fabs(sums.range_m.mean - 20.0 / 12.0) < 1e-6 && fabs(sums.range_m.p05 - 1.0) < 1e-6);
    assert_true(fabs(sums.range_m.p50 - 1.0) < 1e-6 && fabs(sums.range_m.p95 - 4.0) < 1e-6);
    assert_true(fabs(sums.incidence_rad.p50 - acos(0.5)) < 1e-6);
    coverage_by_label(&c, label);
    assert_true(label[0].area_m2 == 9.0 && label[0].seen_m2 == 9.0 && label[0].several_m2 == 1.0);
    assert_true(label[1].area_m2 == 7.0 && label[1].seen_m2 == 3.0 && label[1].several_m2 == 1.0);
    assert_true(label[0].pulses == 50 && label[1].pulses == 45);
    coverage_alone(&c, alone_m2);
    assert_true(alone_m2[0] == 2.0 && alone_m2[1] == 8.0 && alone_m2[2] == 0.0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_partition), cmocka_unit_test(test_points_are_found),
        cmocka_unit_test(test_border),    cmocka_unit_test(test_needle),
        cmocka_unit_test(test_sums),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
