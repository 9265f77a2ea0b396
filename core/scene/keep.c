/* SPDX-License-Identifier: MIT */
/* Leaves some surfaces out of a scene. */
#include <stdlib.h>
#include <string.h>

#include "core/grow.h"
#include "core/scene/copies.h"
#include "core/vec3.h"

/* Keeps the triangles of surfaces that are kept, with the new labels. The triangles' vertices get numbers in the old
 * order. */
static void keep_triangles(struct scene *s, const uint8_t *keep, const uint16_t *label, uint32_t *vertex)
{
    uint32_t n = 0;
    for (uint32_t i = 0; i < s->n_triangles; i++) {
        const uint16_t was = s->label[i];
        if (!keep[was]) continue;
        memcpy(s->triangle[n], s->triangle[i], sizeof s->triangle[n]);
        if (s->uv != NULL) memcpy(s->uv[n], s->uv[i], sizeof s->uv[n]);
        if (s->rgb != NULL) memcpy(s->rgb[n], s->rgb[i], sizeof s->rgb[n]);
        s->label[n++] = label[was];
    }
    s->n_triangles = n;
    for (uint32_t i = 0; i < n; i++)
        for (int c = 0; c < 3; c++)
            vertex[s->triangle[i][c]] = 1;
    n = 0;
    for (uint32_t v = 0; v < s->n_vertices; v++) {
        if (!vertex[v]) continue;
        memcpy(s->vertex_m[n], s->vertex_m[v], sizeof s->vertex_m[n]);
        vertex[v] = n++;
    }
    s->n_vertices = n;
    for (uint32_t i = 0; i < s->n_triangles; i++)
        for (int c = 0; c < 3; c++)
            s->triangle[i][c] = vertex[s->triangle[i][c]];
}

int scene_keep(struct scene *s, const uint8_t *keep, struct sh_err *err)
{
    uint16_t *label = calloc((size_t)s->n_surfaces + 1, sizeof *label);
    uint32_t *vertex = calloc((size_t)s->n_vertices + 1, sizeof *vertex), n = 0;
    const int enough = label != NULL && vertex != NULL;
    for (uint32_t i = 0; i < s->n_surfaces && enough; i++) {
        if (!keep[i]) continue;
        if (s->cutout != NULL) s->cutout[n] = s->cutout[i];
        s->surface[n] = s->surface[i];
        label[i] = (uint16_t)n++;
    }
    int rc = enough ? SH_OK : sh_fail(err, SH_ENOMEM, "no memory to leave out surfaces");
    if (rc == SH_OK) {
        keep_triangles(s, keep, label, vertex);
        s->n_surfaces = n;
        s->n_all = s->n_triangles;
        vec3_bound_nothing(s->min_m, s->max_m);
        for (uint32_t v = 0; v < s->n_vertices; v++)
            vec3_bound(s->min_m, s->max_m, s->vertex_m[v]);
        /* Where memory can't be given back, it stays. */
        if (s->triangle != NULL) resize(&s->triangle, s->n_triangles, sizeof *s->triangle);
        if (s->label != NULL) resize(&s->label, s->n_triangles, sizeof *s->label);
        if (s->uv != NULL) resize(&s->uv, s->n_triangles, sizeof *s->uv);
        if (s->rgb != NULL) resize(&s->rgb, s->n_triangles, sizeof *s->rgb);
        if (s->vertex_m != NULL) resize(&s->vertex_m, s->n_vertices, sizeof *s->vertex_m);
        rc = scene_keep_copies(s, keep, label, err);
    }
    free(label);
    free(vertex);
    return rc;
}
