/* SPDX-License-Identifier: MIT */
/* Turns copies into triangles of the scene, for tools that can't use copies. Each triangle keeps its number. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/grow.h"
#include "core/scene_copies.h"

/* Sets texture coordinates to NaN: these triangles have none. */
static void fill_uv(struct scene *scene, uint32_t from, uint32_t to)
{
    for (uint32_t i = from; i < to; i++)
        for (int k = 0; k < 6; k++)
            scene->uv[i][k / 2][k % 2] = NAN;
}

static int write_out_make_room(struct scene *s, uint64_t vertices, uint64_t triangles, int uv, int rgb, int cutouts)
{
    const int had_uv = s->uv != NULL, had_rgb = s->rgb != NULL, had_cutouts = s->cutout != NULL;
    if (!resize(&s->vertex_m, vertices, sizeof *s->vertex_m) || !resize(&s->triangle, triangles, sizeof *s->triangle) ||
        !resize(&s->label, triangles, sizeof *s->label))
        return 0;
    if ((uv || had_uv) && !resize(&s->uv, triangles, sizeof *s->uv)) return 0;
    if (uv && !had_uv) fill_uv(s, 0, s->n_triangles);
    if ((rgb || had_rgb) && !resize(&s->rgb, triangles, sizeof *s->rgb)) return 0;
    if (rgb && !had_rgb) memset(s->rgb, 0, s->n_triangles * sizeof *s->rgb);
    if (!cutouts && !had_cutouts) return 1;
    if (!resize(&s->cutout, s->n_surfaces, sizeof *s->cutout)) return 0;
    if (!had_cutouts) memset(s->cutout, 0, s->n_surfaces * sizeof *s->cutout);
    return 1;
}

static void write_copy(struct scene *s, const struct scene *mesh, const struct scene_copy *copy)
{
    const uint32_t first = s->n_vertices, triangle0 = s->n_triangles;
    for (uint32_t i = 0; i < mesh->n_vertices; i++)
        scene_copy_put(copy, mesh->vertex_m[i], s->vertex_m[s->n_vertices++]);
    for (uint32_t i = 0; i < mesh->n_triangles; i++) {
        const uint32_t at = s->n_triangles++;
        for (int k = 0; k < 3; k++)
            s->triangle[at][k] = first + mesh->triangle[i][k];
        s->label[at] = (uint16_t)(s->label0 + copy->label0 + mesh->label[i]);
        if (mesh->uv != NULL) memcpy(s->uv[at], mesh->uv[i], sizeof *s->uv);
        if (mesh->rgb != NULL) memcpy(s->rgb[at], mesh->rgb[i], sizeof *s->rgb);
    }
    if (s->rgb != NULL && mesh->rgb == NULL) memset(s->rgb[triangle0], 0, mesh->n_triangles * sizeof *s->rgb);
    if (s->uv != NULL && mesh->uv == NULL) fill_uv(s, triangle0, s->n_triangles);
    for (uint32_t i = 0; s->cutout != NULL && i < mesh->n_surfaces; i++)
        s->cutout[copy->label0 + i] = mesh->cutout != NULL ? mesh->cutout[i] : NULL;
}

/* The holes of the mesh are the scene's from now on. */
static int take_masks(struct scene *s, struct scene *mesh)
{
    if (mesh->n_masks == 0) return 1;
    if (!resize(&s->mask, s->n_masks + mesh->n_masks, sizeof(struct texture_mask *))) return 0;
    memcpy(s->mask + s->n_masks, mesh->mask, mesh->n_masks * sizeof(struct texture_mask *));
    s->n_masks += mesh->n_masks;
    mesh->n_masks = 0;
    return 1;
}

int scene_write_out_copies(struct scene *s, uint64_t most, const struct sh_report *report, struct sh_err *err)
{
    uint64_t vertices = s->n_vertices;
    int uv = 0, rgb = 0, cutouts = 0, rc = SH_OK;
    if (s->n_copies == 0) return SH_OK;
    for (uint32_t i = 0; i < s->n_copied; i++) {
        vertices += (uint64_t)s->copied[i].n * s->copied[i].mesh->n_vertices;
        uv |= s->copied[i].mesh->uv != NULL;
        rgb |= s->copied[i].mesh->rgb != NULL;
        cutouts |= s->copied[i].mesh->cutout != NULL;
    }
    if (s->n_all > most || vertices > UINT32_MAX - 1)
        return sh_fail(
            err, SH_EINPUT,
            "scene.meshes[].copies: %u copies come to %u triangles; reports, coverage and the page of `run` need each "
            "of them in memory: allowed are %llu at most",
            s->n_copies, s->n_all, (unsigned long long)most);
    if (!write_out_make_room(s, vertices, s->n_all, uv, rgb, cutouts))
        return sh_fail(err, SH_ENOMEM, "no memory for the %u triangles of copies", s->n_all);
    for (uint32_t i = 0; i < s->n_copied && rc == SH_OK; i++) {
        struct scene_copied *of = &s->copied[i];
        if (!take_masks(s, of->mesh)) rc = sh_fail(err, SH_ENOMEM, "no memory for the holes of copies");
        for (uint32_t k = 0; k < of->n && rc == SH_OK; k++) {
            rc = sh_check_stop(report, err);
            write_copy(s, of->mesh, &of->copy[k]);
        }
    }
    if (rc != SH_OK) return rc;
    for (uint32_t i = 0; i < s->n_copied; i++) {
        scene_free(s->copied[i].mesh);
        free(s->copied[i].copy);
    }
    s->n_copied = s->n_copies = 0;
    return SH_OK;
}
