/* Faces that stand in a mesh twice: Embree may propose either, so the later ones are taken from it. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/bvh/bvh_inside.h"
#include "core/rng.h"

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

static uint64_t hash_corners(const double *const corner[3])
{
    uint64_t h = 0;
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) {
            uint64_t bits;
            memcpy(&bits, &corner[i][j], sizeof bits);
            h = rng_mix(h + 0x9e3779b97f4a7c15ULL + bits);
        }
    return h;
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

/* The bitmap is only there where there are twins. */
static int note_twin(struct bvh *bvh, uint32_t prim, struct sh_err *err)
{
    if (bvh->twin == NULL) bvh->twin = calloc((size_t)bvh->scene->n_triangles / 64 + 1, sizeof *bvh->twin);
    if (bvh->twin == NULL) return sh_fail(err, SH_ENOMEM, "bvh: no memory to mark triangles that stand twice");
    bvh->twin[prim / 64] |= 1ULL << prim % 64;
    return SH_OK;
}

int bvh_is_twin(const struct bvh *bvh, uint32_t triangle)
{
    return bvh->twin != NULL && (bvh->twin[triangle / 64] >> triangle % 64 & 1) != 0;
}

int bvh_drop_twins(struct bvh *bvh, float *vertex, const struct sh_report *report, struct sh_err *err)
{
    const struct scene *scene = bvh->scene;
    uint64_t size = 16;
    while (size < 2 * (uint64_t)scene->n_triangles)
        size *= 2;
    uint32_t *table = malloc(size * sizeof *table);
    if (table == NULL) return sh_fail(err, SH_ENOMEM, "cast: no memory to compare %u triangles", scene->n_triangles);
    memset(table, 0xff, size * sizeof *table);
    int rc = SH_OK;
    for (uint32_t prim = 0; prim < scene->n_triangles && rc == SH_OK; prim++) {
        if ((prim & 0xffff) == 0) rc = sh_check_stop(report, err);
        const double *corner[3], *other[3];
        sorted_corners(scene, prim, corner);
        uint64_t at = hash_corners(corner) & (size - 1);
        for (; table[at] != UINT32_MAX; at = (at + 1) & (size - 1)) {
            sorted_corners(scene, table[at], other);
            if (!same_corners(corner, other)) continue;
            if (scene->cutout != NULL && !same_holes(scene, prim, table[at])) continue;
            for (int i = 0; i < 9; i++)
                vertex[9 * (size_t)prim + (size_t)i] = NAN; /* Embree leaves out what is not finite */
            rc = note_twin(bvh, prim, err);
            break;
        }
        if (table[at] == UINT32_MAX) table[at] = prim;
    }
    free(table);
    return rc;
}
