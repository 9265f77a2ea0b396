/* SPDX-License-Identifier: MIT */
/* Coarse meshes by vertex clustering: counts by hand, bounds, refusals. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

#include "core/studio/decimate.h"
#include "core/rng.h"

static const double CUBE[8][3] = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {1, 1, 0},
                                  {0, 0, 1}, {1, 0, 1}, {0, 1, 1}, {1, 1, 1}};
static const uint32_t CUBE_FACE[12][3] = {{0, 2, 1}, {1, 2, 3}, {4, 5, 6}, {5, 7, 6}, {0, 1, 4}, {1, 5, 4},
                                          {2, 6, 3}, {3, 6, 7}, {0, 4, 2}, {2, 4, 6}, {1, 3, 5}, {3, 7, 5}};

/* n x n quads on the square from x, y = 0 to size, at z(x, y), with two triangles each. */
struct sheet {
    double (*vertex_m)[3];
    uint32_t (*triangle)[3];
    struct decimate_mesh mesh;
};

static void make_sheet(struct sheet *s, uint32_t n, double size_m, double rough_m)
{
    uint32_t t = 0;
    s->vertex_m = calloc((size_t)(n + 1) * (n + 1), sizeof *s->vertex_m);
    s->triangle = calloc(2 * (size_t)n * n, sizeof *s->triangle);
    assert_true(s->vertex_m != NULL && s->triangle != NULL);
    for (uint32_t i = 0; i <= n; i++)
        for (uint32_t k = 0; k <= n; k++) {
            double *v = s->vertex_m[i * (n + 1) + k];
            v[0] = size_m * i / n;
            v[1] = size_m * k / n;
            v[2] = rough_m * (double)(rng_mix(i * 7919 + k) >> 11) * 0x1p-53;
        }
    for (uint32_t i = 0; i < n; i++)
        for (uint32_t k = 0; k < n; k++) {
            const uint32_t a = i * (n + 1) + k, b = a + n + 1;
            const uint32_t two[2][3] = {{a, b, a + 1}, {a + 1, b, b + 1}};
            for (int j = 0; j < 2; j++, t++)
                for (int c = 0; c < 3; c++)
                    s->triangle[t][c] = two[j][c];
        }
    s->mesh = (struct decimate_mesh){(const double(*)[3])s->vertex_m, (n + 1) * (n + 1),
                                     (const uint32_t(*)[3])s->triangle, t};
}

static void free_sheet(struct sheet *s)
{
    free(s->vertex_m);
    free(s->triangle);
}

static void bounds_of(const struct decimated *m, double low[3], double high[3])
{
    for (int i = 0; i < 3; i++) {
        low[i] = INFINITY;
        high[i] = -INFINITY;
        for (uint32_t v = 0; v < m->n_vertices; v++) {
            low[i] = fmin(low[i], m->vertex_m[v][i]);
            high[i] = fmax(high[i], m->vertex_m[v][i]);
        }
    }
}

/* No triangle is there twice, each has three corners, and each vertex is used. */
static void check_whole(const struct decimated *m)
{
    uint8_t *used = calloc(m->n_vertices + 1, 1);
    assert_non_null(used);
    for (uint32_t t = 0; t < m->n_triangles; t++) {
        const uint32_t *c = m->triangle[t];
        assert_true(c[0] != c[1] && c[1] != c[2] && c[2] != c[0]);
        for (int k = 0; k < 3; k++) {
            assert_true(c[k] < m->n_vertices);
            used[c[k]] = 1;
        }
    }
    for (uint32_t v = 0; v < m->n_vertices; v++)
        assert_int_equal(used[v], 1);
    free(used);
}

/* With the limit above its triangles a mesh isn't touched. */
static void cube_stays(void **state)
{
    (void)state;
    const struct decimate_mesh cube = {CUBE, 8, CUBE_FACE, 12};
    struct decimated m;
    struct sh_err err;
    assert_int_equal(decimate(&cube, DECIMATE_LEAST, NULL, &m, &err), SH_OK);
    assert_true(m.n_vertices == 8 && m.n_triangles == 12 && m.cell_m == 0.0);
    assert_memory_equal(m.vertex_m, CUBE, sizeof CUBE);
    assert_memory_equal(m.triangle, CUBE_FACE, sizeof CUBE_FACE);
    decimated_free(&m);
}

/* 64 x 64 quads on 1 m. The first guess for 100 triangles is a cell of sqrt(3 / 100) m, so 6 steps and cells centred on
 * 0, 1/6 ... 1: 7 x 7. Cell j along an axis has the vertices i with floor(6 i / 64 + 1/2) = j: 0..5, 6..15, 16..26,
 * 27..37, 38..47, 48..58 and 59..64. Triangles with two corners in one cluster vanish. Where two borders cross, two
 * triangles are left: one crossing for each of the 6 x 6 squares between clusters. All quads have their diagonal the
 * same way, so there are no others. */
static void plane_has_counts_by_hand(void **state)
{
    (void)state;
    static const double mean[7] = {2.5 / 64, 10.5 / 64, 21.0 / 64, 32.0 / 64, 42.5 / 64, 53.0 / 64, 61.5 / 64};
    struct sheet s;
    struct decimated m;
    struct sh_err err;
    double low[3], high[3];
    make_sheet(&s, 64, 1.0, 0.0);
    assert_int_equal(decimate(&s.mesh, 100, NULL, &m, &err), SH_OK);
    assert_int_equal(m.n_vertices, 49);
    assert_int_equal(m.n_triangles, 72);
    check_whole(&m);
    int seen[7][7] = {{0}};
    for (uint32_t v = 0; v < 49; v++) {
        const int i = (int)floor(6.0 * m.vertex_m[v][0] + 0.5), k = (int)floor(6.0 * m.vertex_m[v][1] + 0.5);
        seen[i][k]++;
        /* sums of up to 121 multiples of 1/64 are exact */
        assert_true(m.vertex_m[v][0] == mean[i] && m.vertex_m[v][1] == mean[k] && m.vertex_m[v][2] == 0.0);
    }
    for (int i = 0; i < 49; i++)
        assert_int_equal(seen[i / 7][i % 7], 1);
    bounds_of(&m, low, high);
    for (int i = 0; i < 2; i++)
        assert_true(low[i] >= 0.0 && low[i] <= 1.0 / 12 && high[i] <= 1.0 && high[i] >= 11.0 / 12);
    decimated_free(&m);
    free_sheet(&s);
}

/* Each of 100 triangles has three corners nearly in a row, farther apart than a cell is wide. One more is the first one
 * turned over. The number that was asked for is reached exactly, and the first one stays as it was. */
static void as_many_as_allowed(void **state)
{
    (void)state;
    static double v[300][3];
    static uint32_t face[101][3];
    for (uint32_t i = 0; i < 101; i++)
        for (uint32_t k = 0; k < 3; k++) {
            face[i][k] = i < 100 ? 3 * i + k : 2 - k;
            if (i < 100)
                memcpy(v[3 * i + k], (const double[3]){10.0 * i + 2.0 * k, k == 1 ? 0.001 : 0, 0}, sizeof v[0]);
        }
    const struct decimate_mesh mesh = {(const double(*)[3])v, 300, (const uint32_t(*)[3])face, 101};
    struct decimated m;
    struct sh_err err;
    assert_int_equal(decimate(&mesh, 100, NULL, &m, &err), SH_OK);
    assert_true(m.n_triangles == 100 && m.n_vertices == 300 && m.cell_m > 0 && m.cell_m < 2);
    assert_memory_equal(m.vertex_m, v, sizeof v);
    assert_memory_equal(m.triangle, face, 100 * sizeof *face);
    decimated_free(&m);
}

/* A rough sheet far from the origin, as in UTM: no more triangles than asked for, not far fewer, bounds within half a
 * cell along each axis, all heights within the bounds. */
static void limit_holds(void **state)
{
    (void)state;
    struct sheet s;
    struct decimated m;
    struct sh_err err;
    double low[3], high[3], was_low = INFINITY, was_high = -INFINITY;
    make_sheet(&s, 100, 50.0, 0.3);
    for (uint32_t v = 0; v < s.mesh.n_vertices; v++) {
        was_low = fmin(was_low, s.vertex_m[v][2]);
        was_high = fmax(was_high, s.vertex_m[v][2]);
        s.vertex_m[v][0] += 500000.0;
        s.vertex_m[v][1] += 5400000.0;
    }
    assert_int_equal(decimate(&s.mesh, 2000, NULL, &m, &err), SH_OK);
    assert_true(m.n_triangles <= 2000 && m.n_triangles >= 500);
    check_whole(&m);
    const double was[3][2] = {{500000.0, 500050.0}, {5400000.0, 5400050.0}, {was_low, was_high}};
    bounds_of(&m, low, high);
    for (int i = 0; i < 3; i++)
        assert_true(low[i] >= was[i][0] && low[i] <= was[i][0] + 0.5 * m.cell_m && high[i] <= was[i][1] &&
                    high[i] >= was[i][1] - 0.5 * m.cell_m);
    decimated_free(&m);
    free_sheet(&s);
}

/* Two sheets nearer than a cell become one: of two triangles between the same cells one is left, whichever way they
 * face. A triangle up to z = 1 makes the mesh as high as it is wide. The first guess has too few triangles; the second
 * one is of 7 steps. */
static void doubles_become_one(void **state)
{
    (void)state;
    enum { N = 11 * 11, FACES = 200 };
    static double vertex[2 * N + 1][3];
    static uint32_t face[2 * FACES + 1][3];
    struct sheet s;
    struct decimated m;
    struct sh_err err;
    make_sheet(&s, 10, 1.0, 0.0);
    memcpy(vertex, s.vertex_m, N * sizeof *vertex);
    memcpy(face, s.triangle, FACES * sizeof *face);
    for (int i = 0; i < N; i++)
        for (int k = 0; k < 3; k++)
            vertex[N + i][k] = vertex[i][k] + (k == 2 ? 0.001 : 0.0);
    for (int i = 0; i < FACES; i++)
        for (int k = 0; k < 3; k++)
            face[FACES + i][k] = N + face[i][2 - k];
    vertex[2 * N][2] = 1.0;
    memcpy(face[2 * FACES], (const uint32_t[3]){0, 10, 2 * N}, sizeof *face);
    const struct decimate_mesh both = {(const double(*)[3])vertex, 2 * N + 1, (const uint32_t(*)[3])face,
                                       2 * FACES + 1};
    assert_int_equal(decimate(&both, 100, NULL, &m, &err), SH_OK);
    assert_int_equal(m.n_triangles, 2 * 7 * 7 + 1);
    assert_int_equal(m.n_vertices, 8 * 8 + 1);
    check_whole(&m);
    decimated_free(&m);
    free_sheet(&s);
}

static int stop_now(void *ctx)
{
    (void)ctx;
    return 1;
}

static void refuses(void **state)
{
    (void)state;
    const struct decimate_mesh cube = {CUBE, 8, CUBE_FACE, 12}, none = {CUBE, 0, CUBE_FACE, 0};
    const struct sh_report stops = {.stop = stop_now};
    struct sheet s;
    struct decimated m;
    struct sh_err err;
    assert_int_equal(decimate(&cube, DECIMATE_LEAST - 1, NULL, &m, &err), SH_EINPUT);
    make_sheet(&s, 8, 1.0, 0.0);
    assert_int_equal(decimate(&s.mesh, DECIMATE_LEAST, &stops, &m, &err), SH_ESTOPPED);
    assert_true(m.n_triangles == 0 && m.vertex_m == NULL);
    free_sheet(&s);
    assert_int_equal(decimate(&none, DECIMATE_LEAST, NULL, &m, &err), SH_OK);
    assert_int_equal(m.n_triangles, 0);
    decimated_free(&m);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(cube_stays),  cmocka_unit_test(plane_has_counts_by_hand), cmocka_unit_test(as_many_as_allowed),
        cmocka_unit_test(limit_holds), cmocka_unit_test(doubles_become_one),       cmocka_unit_test(refuses),
    };
    return cmocka_run_group_tests_name("decimate", tests, NULL, NULL);
}
