/* SPDX-License-Identifier: MIT */
#include "tests/bench/closed_mesh.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "tests/common/generate.h"

enum { MAX_DIVIDE = 6 };

struct builder {
    double (*vertex)[3];
    uint32_t (*triangle)[3];
    uint32_t n_vertices, n_triangles;
};

static int reserve(struct builder *b, size_t n_vertices, size_t n_triangles, struct sh_err *err)
{
    *b = (struct builder){malloc(n_vertices * sizeof *b->vertex), malloc(n_triangles * sizeof *b->triangle), 0, 0};
    if (b->vertex != NULL && b->triangle != NULL) return SH_OK;
    return sh_fail(err, SH_ENOMEM, "bench: no memory for a mesh");
}

static int finish(struct builder *b, int rc, struct scene **out, struct sh_err *err)
{
    if (rc == SH_OK)
        rc = scene_from_arrays(&(struct scene_arrays){(const double(*)[3])b->vertex, b->n_vertices,
                                                      (const uint32_t(*)[3])b->triangle, b->n_triangles, NULL, NULL, 0},
                               out, err);
    free(b->vertex);
    free(b->triangle);
    return rc;
}

/* Gives a point of one of the six faces. The first axis x the second axis of a face points outward. */
static void box_point(int face, uint32_t i, uint32_t j, uint32_t cells, double half_m, double p[3])
{
    int axis = face / 2, up = face % 2;
    double u = half_m * (2.0 * i / cells - 1.0), v = half_m * (2.0 * j / cells - 1.0);
    p[axis] = up ? half_m : -half_m;
    p[(axis + 1) % 3] = up ? u : v;
    p[(axis + 2) % 3] = up ? v : u;
}

/* Adds faces of cells x cells quads. Neighbours share corners bit by bit, since both compute them alike. The box is
 * turned about z and x a little, so that nothing lies along an axis. */
static void add_box(struct builder *b, uint32_t cells, double half_m)
{
    const double c = cos(0.3), s = sin(0.3), c2 = cos(0.2), s2 = sin(0.2);
    for (int face = 0; face < 6; face++) {
        uint32_t base = b->n_vertices, row = cells + 1;
        for (uint32_t j = 0; j <= cells; j++)
            for (uint32_t i = 0; i <= cells; i++) {
                double p[3], *v = b->vertex[b->n_vertices++];
                box_point(face, i, j, cells, half_m, p);
                double y = s * p[0] + c * p[1];
                v[0] = c * p[0] - s * p[1];
                v[1] = c2 * y - s2 * p[2];
                v[2] = s2 * y + c2 * p[2];
            }
        for (uint32_t j = 0; j < cells; j++)
            for (uint32_t i = 0; i < cells; i++) {
                uint32_t a = base + j * row + i;
                const uint32_t t[2][3] = {{a, a + 1, a + row + 1}, {a, a + row + 1, a + row}};
                memcpy(b->triangle[b->n_triangles], t, sizeof t);
                b->n_triangles += 2;
            }
    }
}

/* A box of 40 m with fine walls lies close inside one of 41 m. */
static int nested_boxes(struct bench_mesh *mesh, struct sh_err *err)
{
    const uint32_t cells = 40;
    struct builder b;
    int rc = reserve(&b, (size_t)12 * (cells + 1) * (cells + 1), (size_t)24 * cells * cells, err);
    if (rc == SH_OK) {
        add_box(&b, cells, 20.0);
        mesh->n_inner = b.n_triangles;
        add_box(&b, cells, 20.5);
    }
    mesh->station_m[0] = 3.1;
    mesh->station_m[1] = -2.3;
    mesh->station_m[2] = 1.7;
    return finish(&b, rc, &mesh->scene, err);
}

static uint32_t middle(struct builder *b, uint32_t i, uint32_t j, double radius_m)
{
    double *v = b->vertex[b->n_vertices], length2 = 0.0;
    for (int k = 0; k < 3; k++) {
        v[k] = b->vertex[i][k] + b->vertex[j][k];
        length2 += v[k] * v[k];
    }
    for (int k = 0; k < 3; k++)
        v[k] *= radius_m / sqrt(length2);
    return b->n_vertices++;
}

/* Cuts every triangle into four. Both triangles of an edge make its middle from the same numbers, up to the order of a
 * sum, which doesn't matter. So the mesh stays closed without a search for corners that are there already. */
static void divide(struct builder *b, double radius_m)
{
    for (uint32_t i = b->n_triangles; i-- > 0;) {
        uint32_t t[3], m[3];
        memcpy(t, b->triangle[i], sizeof t);
        for (int k = 0; k < 3; k++)
            m[k] = middle(b, t[k], t[(k + 1) % 3], radius_m);
        const uint32_t cut[4][3] = {{t[0], m[0], m[2]}, {t[1], m[1], m[0]}, {t[2], m[2], m[1]}, {m[0], m[1], m[2]}};
        memcpy(b->triangle[i], cut[0], sizeof cut[0]);
        memcpy(b->triangle[b->n_triangles], cut[1], 3 * sizeof cut[0]);
        b->n_triangles += 3;
    }
}

static double distance2(const double a[3], const double b[3])
{
    return (a[0] - b[0]) * (a[0] - b[0]) + (a[1] - b[1]) * (a[1] - b[1]) + (a[2] - b[2]) * (a[2] - b[2]);
}

/* Corners of an icosahedron that are neighbours make its faces. The faces are turned so that normals point outward. */
static void add_icosahedron(struct builder *b, double radius_m)
{
    const double g = 0.5 * (1.0 + sqrt(5.0)), scale = radius_m / sqrt(1.0 + g * g), near2 = 5.0 * scale * scale;
    double(*p)[3] = b->vertex;
    for (int i = 0; i < 12; i++) { /* (0, +-1, +-g) and its cyclic turns; edges are 2 long */
        p[i][i / 4] = 0.0;
        p[i][(i / 4 + 1) % 3] = scale * (i & 1 ? -1.0 : 1.0);
        p[i][(i / 4 + 2) % 3] = scale * g * (i & 2 ? -1.0 : 1.0);
    }
    b->n_vertices = 12;
    for (uint32_t i = 0; i < 12; i++)
        for (uint32_t j = i + 1; j < 12; j++)
            for (uint32_t k = j + 1; k < 12; k++) {
                if (distance2(p[i], p[j]) > near2 || distance2(p[j], p[k]) > near2 || distance2(p[i], p[k]) > near2)
                    continue;
                double volume = p[i][0] * (p[j][1] * p[k][2] - p[j][2] * p[k][1]) +
                                p[i][1] * (p[j][2] * p[k][0] - p[j][0] * p[k][2]) +
                                p[i][2] * (p[j][0] * p[k][1] - p[j][1] * p[k][0]);
                const uint32_t t[3] = {i, volume > 0.0 ? j : k, volume > 0.0 ? k : j};
                memcpy(b->triangle[b->n_triangles++], t, sizeof t);
            }
}

static int sphere(struct bench_mesh *mesh, struct sh_err *err)
{
    const double radius_m = 30.0;
    struct builder b;
    size_t n = (size_t)20 << (2 * MAX_DIVIDE);
    int rc = reserve(&b, 12 + n, n, err); /* each triangle that is cut makes three new corners and three triangles */
    if (rc == SH_OK) {
        add_icosahedron(&b, radius_m);
        for (int i = 0; i < MAX_DIVIDE; i++)
            divide(&b, radius_m);
    }
    mesh->station_m[0] = 7.3;
    mesh->station_m[1] = 11.9;
    mesh->station_m[2] = -5.1;
    return finish(&b, rc, &mesh->scene, err);
}

static int terrain(uint32_t n_triangles, struct bench_mesh *mesh, struct sh_err *err)
{
    static const double centre_m[2] = {0.0, 0.0};
    mesh->station_m[2] = 4.7;
    return generate_terrain(n_triangles, 200.0, 3.0, centre_m, 1, &mesh->scene, err);
}

/* The first 2 c^2 of 4 c^2 + 8 c triangles are the ground, whose normals point up. */
static uint32_t ground(uint32_t n_triangles)
{
    uint32_t cells = (uint32_t)lround(sqrt(0.25 * n_triangles + 1.0) - 1.0);
    return 2 * cells * cells;
}

int bench_mesh_create(int which, struct bench_mesh *mesh, struct sh_err *err)
{
    static const char *const names[] = {"terrain 100k", "terrain 1M", "sphere", "box in box"};
    memset(mesh, 0, sizeof *mesh);
    mesh->name = names[which];
    int rc = which == 0   ? terrain(100000, mesh, err)
             : which == 1 ? terrain(1000000, mesh, err)
             : which == 2 ? sphere(mesh, err)
                          : nested_boxes(mesh, err);
    if (rc != SH_OK) return rc;
    if (which < 2) mesh->n_turned = ground(mesh->scene->n_triangles);
    if (mesh->n_inner == 0) mesh->n_inner = mesh->scene->n_triangles;
    mesh->n_aim = mesh->n_inner;
    return SH_OK;
}
