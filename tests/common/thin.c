/* SPDX-License-Identifier: MIT */
/* Thin bodies in front of a backdrop: wires and railings, leaves. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "tests/common/generate.h"
#include "core/rng.h"
#include "core/vec3.h"

enum { SIDES = 8, BOX_VERTICES = 8, BOX_TRIANGLES = 12 };

struct builder {
    double (*vertex)[3];
    uint32_t (*triangle)[3];
    uint16_t *label;
    uint32_t n_vertices, n_triangles;
};

static int reserve(struct builder *b, size_t n_vertices, size_t n_triangles, struct sh_err *err)
{
    *b = (struct builder){.vertex = malloc(n_vertices * sizeof *b->vertex),
                          .triangle = malloc(n_triangles * sizeof *b->triangle),
                          .label = malloc(n_triangles * sizeof *b->label)};
    if (b->vertex != NULL && b->triangle != NULL && b->label != NULL) return SH_OK;
    return sh_fail(err, SH_ENOMEM, "generate: no memory for %zu triangles", n_triangles);
}

static int finish(struct builder *b, int rc, uint32_t n_surfaces, struct scene **out, struct sh_err *err)
{
    struct scene_surface *surface = calloc(n_surfaces, sizeof *surface);
    if (rc == SH_OK && surface == NULL) rc = sh_fail(err, SH_ENOMEM, "generate: no memory");
    for (uint32_t i = 0; rc == SH_OK && i < n_surfaces; i++) {
        strcpy(surface[i].object, i == 0 ? "backdrop" : "thin");
        surface[i].material[0] = (char)('a' + i % 26);
    }
    if (rc == SH_OK)
        rc = scene_from_arrays(&(struct scene_arrays){(const double(*)[3])b->vertex, b->n_vertices,
                                                      (const uint32_t(*)[3])b->triangle, b->n_triangles, b->label,
                                                      surface, n_surfaces},
                               out, err);
    free(surface);
    free(b->vertex);
    free(b->triangle);
    free(b->label);
    return rc;
}

static void add_triangle(struct builder *b, uint32_t i, uint32_t j, uint32_t k, uint16_t label)
{
    uint32_t *t = b->triangle[b->n_triangles];
    t[0] = i;
    t[1] = j;
    t[2] = k;
    b->label[b->n_triangles++] = label;
}

static void add_box(struct builder *b, double half_m)
{
    static const uint32_t face[6][4] = {{0, 2, 6, 4}, {1, 5, 7, 3}, {0, 4, 5, 1},
                                        {2, 3, 7, 6}, {0, 1, 3, 2}, {4, 6, 7, 5}};
    uint32_t base = b->n_vertices;
    for (uint32_t v = 0; v < BOX_VERTICES; v++)
        for (uint32_t i = 0; i < 3; i++)
            b->vertex[base + v][i] = v >> i & 1 ? half_m : -half_m;
    b->n_vertices += BOX_VERTICES;
    for (int f = 0; f < 6; f++) {
        add_triangle(b, base + face[f][0], base + face[f][1], base + face[f][2], 0);
        add_triangle(b, base + face[f][0], base + face[f][2], base + face[f][3], 0);
    }
}

/* Two axes at right angles to the bar's. */
static void across(const double axis[3], double e1[3], double e2[3])
{
    const double other[3] = {fabs(axis[2]) < 0.9 ? 0.0 : 1.0, 0.0, fabs(axis[2]) < 0.9 ? 1.0 : 0.0};
    vec3_cross(axis, other, e1);
    double length = sqrt(vec3_dot(e1, e1));
    for (int i = 0; i < 3; i++)
        e1[i] /= length;
    vec3_cross(axis, e1, e2);
}

static void add_bar(struct builder *b, const struct generate_bar *bar)
{
    double axis[3], e1[3], e2[3], length = 0.0;
    uint32_t base = b->n_vertices;
    for (int i = 0; i < 3; i++) {
        axis[i] = bar->b[i] - bar->a[i];
        length += axis[i] * axis[i];
    }
    for (int i = 0; i < 3; i++)
        axis[i] /= sqrt(length);
    across(axis, e1, e2);
    for (uint32_t k = 0; k < 2 * SIDES; k++) {
        double phi = 2.0 * M_PI * (k % SIDES) / SIDES, *v = b->vertex[b->n_vertices++];
        const double *end = k < SIDES ? bar->a : bar->b;
        for (int i = 0; i < 3; i++)
            v[i] = end[i] + 0.5 * bar->diameter_m * (cos(phi) * e1[i] + sin(phi) * e2[i]);
    }
    for (uint32_t k = 0; k < SIDES; k++) {
        uint32_t p = base + k, q = base + (k + 1) % SIDES;
        add_triangle(b, p, q, q + SIDES, bar->label);
        add_triangle(b, p, q + SIDES, p + SIDES, bar->label);
    }
    for (uint32_t k = 1; k + 1 < SIDES; k++) {
        add_triangle(b, base, base + k, base + k + 1, bar->label);
        add_triangle(b, base + SIDES, base + SIDES + k, base + SIDES + k + 1, bar->label);
    }
}

int generate_bars(const struct generate_bar *bar, uint32_t n_bars, double half_m, struct scene **out,
                  struct sh_err *err)
{
    struct builder b;
    uint32_t n_surfaces = 1;
    int rc =
        reserve(&b, BOX_VERTICES + (size_t)n_bars * 2 * SIDES, BOX_TRIANGLES + (size_t)n_bars * (4 * SIDES - 4), err);
    if (rc == SH_OK) add_box(&b, half_m);
    for (uint32_t i = 0; i < n_bars && rc == SH_OK; i++) {
        add_bar(&b, &bar[i]);
        if (bar[i].label >= n_surfaces) n_surfaces = bar[i].label + 1U;
    }
    return finish(&b, rc, n_surfaces, out, err);
}

static double between(uint64_t key, uint64_t i)
{
    return 2.0 * (double)(int64_t)(rng_u64(key, i) >> 11) * 0x1p-53 - 1.0;
}

/* Makes a triangle about a point in the crown. The point is uniform in the ball, by rejection. */
static void add_leaf(struct builder *b, const struct generate_crown *crown, uint64_t key, uint64_t *counter)
{
    double p[3], r2;
    do {
        r2 = 0.0;
        for (int i = 0; i < 3; i++) {
            p[i] = between(key, (*counter)++);
            r2 += p[i] * p[i];
        }
    } while (r2 > 1.0);
    uint32_t base = b->n_vertices;
    for (uint32_t v = 0; v < 3; v++)
        for (int i = 0; i < 3; i++)
            b->vertex[base + v][i] =
                crown->centre_m[i] + crown->radius_m * p[i] + 0.5 * crown->size_m * between(key, (*counter)++);
    b->n_vertices += 3;
    add_triangle(b, base, base + 1, base + 2, 1);
}

int generate_foliage(const struct generate_crown *crown, uint32_t n_crowns, double half_m, uint64_t seed,
                     struct scene **out, struct sh_err *err)
{
    struct builder b;
    uint64_t key = rng_key(seed, RNG_SCENE), counter = 0;
    size_t n = 0;
    for (uint32_t i = 0; i < n_crowns; i++)
        n += crown[i].n_leaves;
    int rc = reserve(&b, BOX_VERTICES + 3 * n, BOX_TRIANGLES + n, err);
    if (rc == SH_OK) add_box(&b, half_m);
    for (uint32_t i = 0; i < n_crowns && rc == SH_OK; i++)
        for (uint32_t k = 0; k < crown[i].n_leaves; k++)
            add_leaf(&b, &crown[i], key, &counter);
    return finish(&b, rc, 2, out, err);
}
