/* SPDX-License-Identifier: MIT */
#include "tests/common/generate.h"

#include <math.h>
#include <stdlib.h>

#include "core/rng.h"

struct builder {
    double (*vertex)[3];
    uint32_t (*triangle)[3];
    uint32_t n_vertices, n_triangles;
};

static void add_triangle(struct builder *b, uint32_t i, uint32_t j, uint32_t k)
{
    uint32_t *t = b->triangle[b->n_triangles++];
    t[0] = i;
    t[1] = j;
    t[2] = k;
}

static double unit(uint64_t key, uint64_t i)
{
    return (double)(int64_t)(rng_u64(key, i) >> 11) * 0x1p-53;
}

/* Heights are hills of several widths, and a step of noise on every vertex. */
static double height(double x, double y, double side_m, double rough_m, uint64_t key, uint64_t i)
{
    double h = 0.0;
    for (int k = 1; k <= 4; k++)
        h += sin(x / side_m * 6.3 * k * k + k) * cos(y / side_m * 5.1 * k * k + 2 * k) / (k * k);
    return rough_m * (0.35 * h + 0.1 * unit(key, i));
}

/* A sheet of cells x cells quads. The sheet's border is flat, so that walls can stand on it. */
static void add_sheet(struct builder *b, uint32_t cells, double side_m, double rough_m, double lift_m,
                      const double c[2], uint64_t key)
{
    uint32_t row = cells + 1, base = b->n_vertices;
    for (uint32_t j = 0; j <= cells; j++)
        for (uint32_t i = 0; i <= cells; i++) {
            double *v = b->vertex[b->n_vertices];
            int border = i == 0 || j == 0 || i == cells || j == cells;
            v[0] = side_m * ((double)i / cells - 0.5);
            v[1] = side_m * ((double)j / cells - 0.5);
            v[2] = lift_m + (border ? 0.0 : height(v[0], v[1], side_m, rough_m, key, b->n_vertices));
            v[0] += c[0];
            v[1] += c[1];
            b->n_vertices++;
        }
    for (uint32_t j = 0; j < cells; j++)
        for (uint32_t i = 0; i < cells; i++) {
            uint32_t a = base + j * row + i;
            add_triangle(b, a, a + 1, a + row + 1);
            add_triangle(b, a, a + row + 1, a + row);
        }
}

/* Four walls from the lower sheet's border to the upper one's, vertex by vertex. The walls close without a crack. */
static void add_walls(struct builder *b, uint32_t cells)
{
    uint32_t row = cells + 1, up = row * row;
    uint32_t corner[4] = {0, cells, row * row - 1, row * cells};
    int64_t step[4] = {1, row, -1, -(int64_t)row};
    for (int k = 0; k < 4; k++) {
        uint32_t from = corner[k];
        for (uint32_t i = 0; i < cells; i++) {
            uint32_t to = (uint32_t)(from + step[k]);
            add_triangle(b, from, to, to + up);
            add_triangle(b, from, to + up, from + up);
            from = to;
        }
    }
}

int generate_terrain(uint32_t n_triangles, double side_m, double rough_m, const double centre_m[2], uint64_t seed,
                     struct scene **out, struct sh_err *err)
{
    uint32_t cells = (uint32_t)(sqrt(0.25 * n_triangles + 1.0) - 0.5);
    if (cells < 1) cells = 1;
    size_t n_v = 2 * ((size_t)cells + 1) * (cells + 1), n_t = 4 * (size_t)cells * cells + 8 * (size_t)cells;
    uint64_t key = rng_key(seed, RNG_SCENE);
    struct builder b = {.vertex = malloc(n_v * sizeof *b.vertex), .triangle = malloc(n_t * sizeof *b.triangle)};
    int rc = SH_OK;
    if (b.vertex == NULL || b.triangle == NULL)
        rc = sh_fail(err, SH_ENOMEM, "generate: no memory for %u triangles", n_triangles);
    if (rc == SH_OK) {
        add_sheet(&b, cells, side_m, rough_m, 0.0, centre_m, key);
        add_sheet(&b, cells, side_m, rough_m, 0.3 * side_m, centre_m, key);
        add_walls(&b, cells);
        rc = scene_from_arrays(&(struct scene_arrays){(const double(*)[3])b.vertex, b.n_vertices,
                                                      (const uint32_t(*)[3])b.triangle, b.n_triangles, NULL, NULL, 0},
                               out, err);
    }
    free(b.vertex);
    free(b.triangle);
    return rc;
}
