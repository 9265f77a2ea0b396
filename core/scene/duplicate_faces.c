/* SPDX-License-Identifier: MIT */
/* Finds duplicate faces of a mesh. */
#include <stdlib.h>
#include <string.h>

#include "core/grow.h"
#include "core/rng.h"
#include "core/scene.h"

/* Corners in an order that does not depend on how the face is written. */
static void sorted_corners(const struct scene *scene, uint32_t prim, const double *corner[3])
{
    for (int i = 0; i < 3; i++) {
        const double *p = scene->vertex_m[scene->triangle[prim][i]];
        int at = i;
        for (; at > 0 && memcmp(p, corner[at - 1], 3 * sizeof *p) < 0; at--)
            corner[at] = corner[at - 1];
        corner[at] = p;
    }
}

static int same_corners(const double *const a[3], const double *const b[3])
{
    for (int i = 0; i < 3; i++)
        if (memcmp(a[i], b[i], 3 * sizeof(double)) != 0) return 0;
    return 1;
}

/* Whether both have holes in the same places, or none: the same image at the same corners. */
static int same_holes(const struct scene *scene, uint32_t a, uint32_t b)
{
    const uint32_t *p = scene->triangle[a], *q = scene->triangle[b];
    if (scene_cutout(scene, a) != scene_cutout(scene, b)) return 0;
    if (scene_cutout(scene, a) == NULL) return 1;
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            if (memcmp(scene->vertex_m[p[i]], scene->vertex_m[q[j]], sizeof *scene->vertex_m) == 0 &&
                memcmp(scene->uv[a][i], scene->uv[b][j], sizeof scene->uv[a][i]) != 0)
                return 0;
    return 1;
}

int scene_find_duplicate_faces(const struct scene *scene, const struct sh_report *report, uint64_t **duplicate,
                               struct sh_err *err)
{
    const uint64_t size = grow_table(2 * (uint64_t)scene->n_triangles);
    uint32_t *table = malloc(size * sizeof *table);
    *duplicate = calloc((size_t)scene->n_triangles / 64 + 1, sizeof **duplicate);
    int rc = SH_OK;
    if (table == NULL || *duplicate == NULL)
        rc = sh_fail(err, SH_ENOMEM, "no memory to compare %u triangles", scene->n_triangles);
    else
        memset(table, 0xff, size * sizeof *table);
    for (uint32_t i = 0; i < scene->n_triangles && rc == SH_OK; i++) {
        if ((i & 0xffff) == 0) rc = sh_check_stop(report, err);
        const double *corner[3], *other[3];
        sorted_corners(scene, i, corner);
        uint64_t at = rng_place(rng_place(rng_place(0, corner[0]), corner[1]), corner[2]) & (size - 1);
        for (; table[at] != UINT32_MAX; at = (at + 1) & (size - 1)) {
            sorted_corners(scene, table[at], other);
            if (!same_corners(corner, other)) continue;
            if (scene->cutout != NULL && !same_holes(scene, i, table[at])) continue;
            (*duplicate)[i / 64] |= UINT64_C(1) << i % 64;
            break;
        }
        if (table[at] == UINT32_MAX) table[at] = i;
    }
    free(table);
    if (rc == SH_OK) return SH_OK;
    free(*duplicate);
    *duplicate = NULL;
    return rc;
}
