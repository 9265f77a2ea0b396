/* SPDX-License-Identifier: MIT */
/* The mesh of a complete grid: its triangles, and for each the smallest factor with which the long-edge filter keeps
 * it. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/grow.h"
#include "core/studio/scan_mesh.h"
#include "core/vec3.h"
#include "firmware_sim/app/studio/view/stream.h"

/* Returns the edge ratio, rounded upwards. For each float f, ratio <= f then holds exactly where it holds for the
 * unrounded ratio. */
static float ratio_of(const double (*xyz_m)[3], const uint32_t f[3], double mean_m)
{
    const double *a = xyz_m[f[0]], *b = xyz_m[f[1]], *c = xyz_m[f[2]];
    const double ratio = fmax(vec3_distance(a, b), fmax(vec3_distance(b, c), vec3_distance(c, a))) / mean_m;
    const float near = (float)ratio;
    return (double)near < ratio ? nextafterf(near, INFINITY) : near;
}

/* Sorts by rising ratio, equal ones by rising number. Positive floats are in the order of their bits, which two passes
 * of 16 bits sort. */
static int sort_faces(struct viewed_mesh *m)
{
    enum { BINS = 1 << 16 };
    uint32_t *from = malloc((size_t)m->n_faces * sizeof *from), *count = malloc(BINS * sizeof *count);
    m->order = malloc((size_t)m->n_faces * sizeof *m->order);
    const int ok = from != NULL && count != NULL && m->order != NULL;
    for (int pass = 0; pass < 2 && ok; pass++) {
        uint32_t sum = 0;
        memset(count, 0, BINS * sizeof *count);
        for (int step = 0; step < 2; step++) { /* counts; then places */
            for (uint32_t i = 0; i < m->n_faces; i++) {
                const uint32_t face = pass == 0 ? i : from[i];
                uint32_t bits;
                memcpy(&bits, &m->ratio[face], sizeof bits);
                uint32_t *bin = &count[bits >> 16 * pass & (BINS - 1)];
                if (step == 1) m->order[*bin] = face;
                ++*bin;
            }
            for (uint32_t i = 0; i < BINS && step == 0; i++) {
                const uint32_t n = count[i];
                count[i] = sum;
                sum += n;
            }
        }
        if (pass == 0) memcpy(from, m->order, (size_t)m->n_faces * sizeof *from);
    }
    free(from);
    free(count);
    return ok;
}

/* Takes the triangles over. Their corners become numbers of points, counted from the mesh's first point. */
static int add_mesh(struct viewed_stream *s, struct scan_faces *faces, const double (*xyz_m)[3], struct sh_err *err)
{
    struct viewed *v = s->v;
    if (!grow(&v->mesh, &v->room_meshes, v->n_meshes + 1, sizeof *v->mesh))
        return sh_fail(err, SH_ENOMEM, "%s: no memory for another mesh", v->path);
    struct viewed_mesh *m = &v->mesh[v->n_meshes++];
    *m = (struct viewed_mesh){.station = s->grid.station,
                              .scan = s->grid.scan,
                              .sweep = s->grid.sweep,
                              .first_point = s->at[0],
                              .n_points = s->at[s->grid.n - 1] - s->at[0] + 1,
                              .n_faces = faces->n_faces,
                              .face = faces->face,
                              .mean_edge_m = faces->mean_edge_m,
                              .n_edges = faces->n_edges,
                              .n_flat = faces->n_flat};
    faces->face = NULL;
    m->ratio = malloc((size_t)m->n_faces * sizeof *m->ratio);
    if (m->ratio == NULL) return sh_fail(err, SH_ENOMEM, "%s: no memory for %u triangles", v->path, m->n_faces);
    for (uint32_t i = 0; i < m->n_faces; i++) {
        m->ratio[i] = ratio_of(xyz_m, m->face[i], m->mean_edge_m);
        for (int k = 0; k < 3; k++)
            m->face[i][k] = s->at[m->face[i][k]] - m->first_point;
    }
    return sort_faces(m) ? SH_OK : sh_fail(err, SH_ENOMEM, "%s: no memory to sort %u triangles", v->path, m->n_faces);
}

int viewed_end_grid(struct viewed_stream *s, struct sh_err *err)
{
    const uint32_t n = s->grid.n;
    struct scan_faces faces = {0};
    if (n == 0) return SH_OK;
    double(*xyz_m)[3] = malloc(n * sizeof *xyz_m);
    if (xyz_m == NULL) return sh_fail(err, SH_ENOMEM, "%s: no memory for a grid of %u points", s->v->path, n);
    for (uint32_t i = 0; i < n; i++)
        memcpy(xyz_m[i], s->v->points.xyz_m[s->at[i]], sizeof xyz_m[i]);
    const struct scan_grid grid = mesh_grid_of(&s->grid, (const double(*)[3])xyz_m, 0);
    int rc = scan_faces_make(&grid, &faces, s->report, err);
    if (rc == SH_OK && faces.n_faces > 0) rc = add_mesh(s, &faces, (const double(*)[3])xyz_m, err);
    scan_faces_free(&faces);
    free(xyz_m);
    return rc;
}
