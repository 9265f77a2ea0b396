/* SPDX-License-Identifier: MIT */
/* Vertex clustering; core/studio/decimate.h has the definitions. */
#include "core/studio/decimate.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/studio/mesh/numbering.h"
#include "core/vec3.h"

static const uint32_t NONE = NUMBERING_NONE; /* it also stands for a cluster or a vertex that is not known yet */
enum { AXIS_BITS = 20, MOST_PASSES = 40, STOP_EVERY = 1 << 16 };

struct cluster {
    double sum_m[3]; /* sum of its vertices, counted from low_m */
    uint32_t n;
    uint32_t vertex; /* of the result; NONE: no triangle uses it yet */
};

struct work {
    const struct decimate_mesh *mesh;
    const struct sh_report *report;
    double low_m[3], extent_m[3], area_m2;
    /* of a pass */
    double per_step[3]; /* steps a metre */
    double cell_m;
    uint32_t most;
    uint32_t *of_vertex; /* [n_vertices] its cluster; NONE: not known yet */
    struct numbering clusters, faces;
    struct cluster *cluster;
    uint32_t (*face)[3]; /* of clusters */
    size_t cluster_room, face_room;
};

/* ---- a pass over the mesh */

/* Returns the cluster of a vertex; NONE: no memory. */
static uint32_t cluster_of(struct work *w, uint32_t vertex)
{
    const double *v = w->mesh->vertex_m[vertex];
    const uint32_t known = w->clusters.n;
    uint64_t key[2] = {0, 0};
    if (w->of_vertex[vertex] != NONE) return w->of_vertex[vertex];
    for (int i = 0; i < 3; i++)
        key[0] = key[0] << (AXIS_BITS + 1) | (uint64_t)((v[i] - w->low_m[i]) * w->per_step[i] + 0.5);
    const uint32_t c = numbering_of(&w->clusters, key);
    if (c == NONE || !grow(&w->cluster, &w->cluster_room, (size_t)c + 1, sizeof *w->cluster)) return NONE;
    if (c == known) w->cluster[c] = (struct cluster){.vertex = NONE};
    for (int i = 0; i < 3; i++)
        w->cluster[c].sum_m[i] += v[i] - w->low_m[i];
    w->cluster[c].n++;
    return w->of_vertex[vertex] = c;
}

static void swap_if_above(uint32_t *a, uint32_t *b)
{
    const uint32_t kept = *a;
    if (*a <= *b) return;
    *a = *b;
    *b = kept;
}

/* Adds a triangle of clusters, unless it is there already. Returns 0 where there is no memory. */
static int add_face(struct work *w, const uint32_t c[3])
{
    const uint32_t known = w->faces.n;
    uint32_t s[3] = {c[0], c[1], c[2]};
    swap_if_above(&s[0], &s[1]);
    swap_if_above(&s[1], &s[2]);
    swap_if_above(&s[0], &s[1]);
    const uint32_t f = numbering_of(&w->faces, (const uint64_t[2]){(uint64_t)s[0] << 32 | s[1], s[2]});
    if (f == NONE || !grow(&w->face, &w->face_room, (size_t)f + 1, sizeof *w->face)) return 0;
    if (f == known) memcpy(w->face[f], c, sizeof w->face[f]);
    return 1;
}

static void begin_pass(struct work *w, double cell_m)
{
    w->cell_m = cell_m;
    for (int i = 0; i < 3; i++) {
        const double steps = fmin(ceil(w->extent_m[i] / cell_m), (double)(1 << AXIS_BITS));
        w->per_step[i] = w->extent_m[i] > 0.0 ? steps / w->extent_m[i] : 0.0;
    }
    numbering_clear(&w->clusters);
    numbering_clear(&w->faces);
    memset(w->of_vertex, 0xff, w->mesh->n_vertices * sizeof *w->of_vertex);
}

/* Returns the number of triangles. Where it passes `most`, the pass ends early and returns how many there would be.
 * Negative: an error. */
static double pass(struct work *w, double cell_m, struct sh_err *err)
{
    const struct decimate_mesh *m = w->mesh;
    begin_pass(w, cell_m);
    for (uint32_t t = 0; t < m->n_triangles; t++) {
        uint32_t c[3];
        if (t % STOP_EVERY == 0) {
            sh_progress(w->report, "making a coarse mesh", (double)t / m->n_triangles);
            if (sh_stopped(w->report)) return sh_fail_stopped(err);
        }
        for (int k = 0; k < 3; k++)
            c[k] = cluster_of(w, m->triangle[t][k]);
        if (c[0] == NONE || c[1] == NONE || c[2] == NONE) return sh_fail(err, SH_ENOMEM, "no memory for a coarse mesh");
        if (c[0] == c[1] || c[1] == c[2] || c[2] == c[0]) continue;
        if (!add_face(w, c)) return sh_fail(err, SH_ENOMEM, "no memory for a coarse mesh");
        if (w->faces.n > w->most || w->clusters.n / 4 > w->most)
            return fmax(w->faces.n, w->clusters.n / 4.0) * ((double)m->n_triangles / (t + 1.0));
    }
    return w->faces.n;
}

/* ---- before and after the passes */

/* Finds the bounds and the area of all triangles. */
static void measure(struct work *w)
{
    const struct decimate_mesh *m = w->mesh;
    double high_m[3];
    vec3_bound_nothing(w->low_m, high_m);
    for (uint32_t t = 0; t < m->n_triangles; t++) {
        const double *corner[3];
        double n[3];
        for (int k = 0; k < 3; k++) {
            corner[k] = m->vertex_m[m->triangle[t][k]];
            vec3_bound(w->low_m, high_m, corner[k]);
        }
        vec3_normal(corner[0], corner[1], corner[2], n);
        w->area_m2 += 0.5 * vec3_length(n);
    }
    for (int i = 0; i < 3; i++)
        w->extent_m[i] = m->n_triangles > 0 ? high_m[i] - w->low_m[i] : 0.0;
}

static int make_room(uint32_t n_vertices, uint32_t n_triangles, struct decimated *out, struct sh_err *err)
{
    *out = (struct decimated){.n_vertices = n_vertices, .n_triangles = n_triangles};
    out->vertex_m = malloc(((size_t)n_vertices + 1) * sizeof *out->vertex_m);
    out->triangle = malloc(((size_t)n_triangles + 1) * sizeof *out->triangle);
    if (out->vertex_m != NULL && out->triangle != NULL) return SH_OK;
    decimated_free(out);
    return sh_fail(err, SH_ENOMEM, "no memory for a mesh of %u triangles", n_triangles);
}

/* Clusters that triangles use become vertices, in the order of their triangles. */
static int decimate_keep(const struct work *w, struct decimated *out, struct sh_err *err)
{
    const uint32_t n = w->faces.n;
    uint32_t n_vertices = 0;
    if (make_room(w->clusters.n < 3 * n ? w->clusters.n : 3 * n, n, out, err) != SH_OK) return SH_ENOMEM;
    for (uint32_t t = 0; t < n; t++)
        for (int k = 0; k < 3; k++) {
            struct cluster *c = &w->cluster[w->face[t][k]];
            if (c->vertex == NONE) {
                for (int i = 0; i < 3; i++)
                    out->vertex_m[n_vertices][i] = w->low_m[i] + c->sum_m[i] / c->n;
                c->vertex = n_vertices++;
            }
            out->triangle[t][k] = c->vertex;
        }
    out->n_vertices = n_vertices;
    out->cell_m = w->cell_m;
    return SH_OK;
}

static int copy(const struct decimate_mesh *mesh, struct decimated *out, struct sh_err *err)
{
    if (make_room(mesh->n_vertices, mesh->n_triangles, out, err) != SH_OK) return SH_ENOMEM;
    memcpy(out->vertex_m, mesh->vertex_m, mesh->n_vertices * sizeof *out->vertex_m);
    memcpy(out->triangle, mesh->triangle, mesh->n_triangles * sizeof *out->triangle);
    return SH_OK;
}

static int decimate_set_up(struct work *w, const struct decimate_mesh *mesh, uint32_t most,
                           const struct sh_report *report, struct sh_err *err)
{
    *w = (struct work){.mesh = mesh, .report = report, .most = most};
    w->of_vertex = malloc(((size_t)mesh->n_vertices + 1) * sizeof *w->of_vertex);
    if (w->of_vertex == NULL) return sh_fail(err, SH_ENOMEM, "no memory for a coarse mesh");
    measure(w);
    return SH_OK;
}

static void tear_down(struct work *w)
{
    free(w->of_vertex);
    numbering_free(&w->clusters);
    numbering_free(&w->faces);
    free(w->cluster);
    free(w->face);
}

/* The number of triangles is proportional to 1 / cell^2 where the mesh is finer than the cells. A slanted surface meets
 * one and a half times as many cells of a grid, and each of them has two triangles. A first guess that gives far fewer
 * triangles is made finer once. */
int decimate(const struct decimate_mesh *mesh, uint32_t most, const struct sh_report *report, struct decimated *out,
             struct sh_err *err)
{
    struct work w;
    double n = 0.0;
    *out = (struct decimated){0};
    if (most < DECIMATE_LEAST)
        return sh_fail(err, SH_EINPUT, "a mesh of %u triangles: allowed are %d or more", most, DECIMATE_LEAST);
    if (mesh->n_triangles <= most) return copy(mesh, out, err);
    int rc = decimate_set_up(&w, mesh, most, report, err);
    if (rc != SH_OK) return rc;
    double cell_m = fmax(sqrt(3.0 * w.area_m2 / most), 1e-6 * vec3_length(w.extent_m)), fits_m = INFINITY;
    for (int i = 0; i < MOST_PASSES; i++) {
        n = pass(&w, cell_m, err);
        const int was_too_coarse = n >= 0.0 && n < 0.7 * most && isinf(fits_m);
        if (n <= most && !was_too_coarse) break;
        if (was_too_coarse) fits_m = cell_m;
        const double ratio = 1.03 * sqrt(fmax(n, 1.0) / most);
        cell_m = was_too_coarse ? cell_m * fmin(ratio, 0.9) : fmin(cell_m * fmin(fmax(ratio, 1.1), 4.0), fits_m);
    }
    rc = n < 0.0    ? (int)n
         : n > most ? sh_fail(err, SH_ESTATE, "no cell size gives %u triangles", most)
                    : decimate_keep(&w, out, err);
    tear_down(&w);
    return rc;
}

void decimated_free(struct decimated *mesh)
{
    free(mesh->vertex_m);
    free(mesh->triangle);
    *mesh = (struct decimated){0};
}
