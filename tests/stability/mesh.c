/* SPDX-License-Identifier: MIT */
#include "tests/stability/mesh.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/rng.h"
#include "tests/common/made.h"
#include "tests/stability/table.h"

static void *grown(void *array, uint32_t *capacity, uint32_t need, size_t size)
{
    if (need <= *capacity) return array;
    *capacity = need + need / 2 + 64;
    array = realloc(array, *capacity * size);
    if (array == NULL) fail_msg("no memory for a mesh");
    return array;
}

uint32_t mesh_vertex(struct mesh *mesh, double x, double y, double z)
{
    mesh->vertex = grown(mesh->vertex, &mesh->cap_vertices, mesh->n_vertices + 1, sizeof *mesh->vertex);
    double *v = mesh->vertex[mesh->n_vertices];
    v[0] = x;
    v[1] = y;
    v[2] = z;
    return mesh->n_vertices++;
}

void mesh_triangle(struct mesh *mesh, uint32_t i, uint32_t j, uint32_t k, uint16_t label)
{
    uint32_t capacity = mesh->cap_triangles;
    mesh->triangle = grown(mesh->triangle, &capacity, mesh->n_triangles + 1, sizeof *mesh->triangle);
    mesh->label = grown(mesh->label, &mesh->cap_triangles, mesh->n_triangles + 1, sizeof *mesh->label);
    uint32_t *t = mesh->triangle[mesh->n_triangles];
    t[0] = i;
    t[1] = j;
    t[2] = k;
    mesh->label[mesh->n_triangles++] = label;
}

void mesh_sheet(struct mesh *mesh, const double corner[3], const double u[3], const double v[3], uint32_t nu,
                uint32_t nv, uint16_t label)
{
    uint32_t base = mesh->n_vertices, row = nu + 1;
    for (uint32_t j = 0; j <= nv; j++)
        for (uint32_t i = 0; i <= nu; i++) {
            double p[3];
            for (int k = 0; k < 3; k++)
                p[k] = corner[k] + u[k] * i / nu + v[k] * j / nv;
            mesh_vertex(mesh, p[0], p[1], p[2]);
        }
    for (uint32_t j = 0; j < nv; j++)
        for (uint32_t i = 0; i < nu; i++) {
            uint32_t a = base + j * row + i;
            mesh_triangle(mesh, a, a + 1, a + row + 1, label);
            mesh_triangle(mesh, a, a + row + 1, a + row, label);
        }
}

void mesh_box(struct mesh *mesh, const double min[3], const double max[3], uint16_t label)
{
    static const uint32_t side[6][4] = {{0, 1, 3, 2}, {4, 6, 7, 5}, {0, 4, 5, 1},
                                        {2, 3, 7, 6}, {0, 2, 6, 4}, {1, 5, 7, 3}};
    uint32_t base = mesh->n_vertices;
    for (int i = 0; i < 8; i++)
        mesh_vertex(mesh, i & 1 ? max[0] : min[0], i & 2 ? max[1] : min[1], i & 4 ? max[2] : min[2]);
    for (int i = 0; i < 6; i++) {
        const uint32_t *s = side[i];
        mesh_triangle(mesh, base + s[0], base + s[1], base + s[2], label);
        mesh_triangle(mesh, base + s[0], base + s[2], base + s[3], label);
    }
}

/* ---- spheres: points of the unit sphere, halved edges kept in a table by their two ends */

struct halves {
    uint64_t *edge; /* low * 2^32 + high, 0: free */
    uint32_t *vertex;
    uint32_t mask;
};

static uint32_t halfway(struct mesh *mesh, struct halves *h, uint32_t i, uint32_t j)
{
    uint64_t edge = i < j ? (uint64_t)i << 32 | j : (uint64_t)j << 32 | i;
    uint32_t at = (uint32_t)rng_mix(edge) & h->mask;
    while (h->edge[at] != 0 && h->edge[at] != edge)
        at = (at + 1) & h->mask;
    if (h->edge[at] == edge) return h->vertex[at];
    double p[3], length2 = 0.0;
    for (int k = 0; k < 3; k++) {
        p[k] = mesh->vertex[i][k] + mesh->vertex[j][k];
        length2 += p[k] * p[k];
    }
    double scale = 1.0 / sqrt(length2);
    h->edge[at] = edge;
    h->vertex[at] = mesh_vertex(mesh, p[0] * scale, p[1] * scale, p[2] * scale);
    return h->vertex[at];
}

static void quarter(struct mesh *mesh, uint32_t first, uint16_t label)
{
    uint32_t n = mesh->n_triangles - first, slots = 64;
    while (slots < 4 * n)
        slots *= 2;
    struct halves h = {calloc(slots, sizeof *h.edge), calloc(slots, sizeof *h.vertex), slots - 1};
    if (h.edge == NULL || h.vertex == NULL) fail_msg("no memory for a mesh");
    for (uint32_t t = first; t < first + n; t++) {
        uint32_t c[3], m[3];
        memcpy(c, mesh->triangle[t], sizeof c);
        for (int i = 0; i < 3; i++)
            m[i] = halfway(mesh, &h, c[i], c[(i + 1) % 3]);
        memcpy(mesh->triangle[t], m, sizeof m);
        for (int i = 0; i < 3; i++)
            mesh_triangle(mesh, c[i], m[i], m[(i + 2) % 3], label);
    }
    free(h.edge);
    free(h.vertex);
}

static double edge_m(const struct mesh *mesh, uint32_t i, uint32_t j)
{
    double d[3];
    for (int k = 0; k < 3; k++)
        d[k] = mesh->vertex[i][k] - mesh->vertex[j][k];
    return sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2]);
}

/* Adds the sides of an icosahedron: of its 12 vertices, all triples that lie an edge's length apart. */
static void add_sides(struct mesh *mesh, uint32_t first, double length_m, uint16_t label)
{
    const double upto_m = 1.01 * length_m;
    for (uint32_t i = first; i < first + 12; i++)
        for (uint32_t j = i + 1; j < first + 12; j++)
            for (uint32_t k = j + 1; k < first + 12; k++)
                if (edge_m(mesh, i, j) < upto_m && edge_m(mesh, j, k) < upto_m && edge_m(mesh, k, i) < upto_m)
                    mesh_triangle(mesh, i, j, k, label);
}

void mesh_sphere(struct mesh *mesh, const double centre[3], double radius_m, double rough, unsigned times,
                 uint16_t label)
{
    const double golden = 0.5 * (1.0 + sqrt(5.0)), a = 1.0 / sqrt(1.0 + golden * golden), b = golden * a;
    const double corner[12][3] = {{a, 0, b},  {-a, 0, b},  {a, 0, -b}, {-a, 0, -b}, {b, a, 0},  {b, -a, 0},
                                  {-b, a, 0}, {-b, -a, 0}, {0, b, a},  {0, b, -a},  {0, -b, a}, {0, -b, -a}};
    uint32_t first_v = mesh->n_vertices, first_t = mesh->n_triangles;
    for (int i = 0; i < 12; i++)
        mesh_vertex(mesh, corner[i][0], corner[i][1], corner[i][2]);
    add_sides(mesh, first_v, 2.0 * a, label);
    for (unsigned i = 0; i < times; i++)
        quarter(mesh, first_t, label);
    for (uint32_t i = first_v; i < mesh->n_vertices; i++) {
        double jitter = (double)(int64_t)(rng_u64(7, i) >> 11) * 0x1p-52 - 1.0;
        for (int k = 0; k < 3; k++)
            mesh->vertex[i][k] = centre[k] + radius_m * (1.0 + rough * jitter) * mesh->vertex[i][k];
    }
}

void mesh_add_scene(struct mesh *mesh, const struct scene *scene, uint16_t label)
{
    uint32_t base = mesh->n_vertices;
    for (uint32_t i = 0; i < scene->n_vertices; i++)
        mesh_vertex(mesh, scene->vertex_m[i][0], scene->vertex_m[i][1], scene->vertex_m[i][2]);
    for (uint32_t i = 0; i < scene->n_triangles; i++) {
        const uint32_t *t = scene->triangle[i];
        mesh_triangle(mesh, base + t[0], base + t[1], base + t[2], label);
    }
}

void mesh_move(struct mesh *mesh, uint32_t first, const double r[9], const double offset[3])
{
    for (uint32_t i = first; i < mesh->n_vertices; i++) {
        double *v = mesh->vertex[i], p[3];
        memcpy(p, v, sizeof p);
        for (int k = 0; k < 3; k++)
            v[k] = r[3 * k] * p[0] + r[3 * k + 1] * p[1] + r[3 * k + 2] * p[2] + offset[k];
    }
}

void mesh_unweld(struct mesh *mesh)
{
    for (uint32_t i = 0; i < mesh->n_triangles; i++)
        for (int k = 0; k < 3; k++) {
            double p[3];
            memcpy(p, mesh->vertex[mesh->triangle[i][k]], sizeof p);
            mesh->triangle[i][k] = mesh_vertex(mesh, p[0], p[1], p[2]);
        }
}

void mesh_any_rotation(double r[9])
{
    const double s = sin(0.7), c = cos(0.7), s2 = sin(0.4), c2 = cos(0.4);
    const double rotation[9] = {c, -s * c2, s * s2, s, c * c2, -c * s2, 0.0, s2, c2};
    memcpy(r, rotation, sizeof rotation);
}

struct scene *mesh_scene(const struct mesh *mesh)
{
    struct scene_surface surface[MESH_LABELS] = {{.object = ""}};
    return made_scene(&(struct scene_arrays){(const double(*)[3])mesh->vertex, mesh->n_vertices,
                                             (const uint32_t(*)[3])mesh->triangle, mesh->n_triangles, mesh->label,
                                             surface, MESH_LABELS});
}

void mesh_free(struct mesh *mesh)
{
    free(mesh->vertex);
    free(mesh->triangle);
    free(mesh->label);
    *mesh = (struct mesh){0};
}
