/* SPDX-License-Identifier: MIT */
#include "core/scene.h"

#include <stdlib.h>
#include <string.h>

#include "core/grow.h"
#include "core/scene/build_load.h"
#include "core/scene/cutouts.h"

const struct scene_import_limits scene_import_defaults = {.memory_mib = 8192, .time_s = 300, .files = 64};

static int copy_surfaces(struct scene_build *b, const struct scene_arrays *arrays, struct sh_err *err)
{
    static const struct scene_surface only = {.object = "object", .material = "material"};
    const struct scene_surface *surface = arrays->surface != NULL ? arrays->surface : &only;
    uint32_t n = arrays->surface != NULL ? arrays->n_surfaces : 1;
    if (n == 0 || n > SCENE_MAX_SURFACES)
        return build_fail(b, SH_EINPUT, err, "%u surfaces; allowed are 1 to %d", n, SCENE_MAX_SURFACES);
    if (!grow(&b->scene->surface, &b->cap_surfaces, n, sizeof *surface))
        return build_fail(b, SH_ENOMEM, err, "no memory for %u surfaces", n);
    memcpy(b->scene->surface, surface, n * sizeof *surface);
    for (uint32_t i = 0; i < n; i++) {
        if (memchr(surface[i].object, '\0', SCENE_NAME_LEN) == NULL ||
            memchr(surface[i].material, '\0', SCENE_NAME_LEN) == NULL)
            return build_fail(b, SH_EINPUT, err, "surface %u: a name has no end", i);
        b->scene->surface[i].texture = b->scene->surface[i].opacity = b->scene->surface[i].vertex_colours = 0;
    }
    b->scene->n_surfaces = n;
    return SH_OK;
}

static int copy_triangles(struct scene_build *b, const struct scene_arrays *arrays, struct sh_err *err)
{
    int rc = build_reserve(b, 0, arrays->n_triangles, err);
    if (rc == SH_OK) rc = build_corners(b, 3, err);
    for (uint32_t i = 0; i < arrays->n_triangles && rc == SH_OK; i++) {
        const uint32_t *corner = arrays->triangle[i];
        uint16_t label = arrays->label != NULL ? arrays->label[i] : 0;
        for (int k = 0; k < 3; k++)
            if (corner[k] >= b->scene->n_vertices)
                return build_fail(b, SH_EINPUT, err, "triangle %u: index %u out of range; there are %u vertices", i,
                                  corner[k], b->scene->n_vertices);
        if (label >= b->scene->n_surfaces)
            return build_fail(b, SH_EINPUT, err, "triangle %u: label %u out of range; there are %u surfaces", i, label,
                              b->scene->n_surfaces);
        memcpy(b->corner, corner, sizeof arrays->triangle[i]);
        rc = build_polygon(b, 3, label, err);
    }
    return rc;
}

int scene_from_arrays(const struct scene_arrays *arrays, struct scene **out, struct sh_err *err)
{
    static const struct scene_mesh_spec spec = {.file = "arrays", .scale = 1};
    struct scene_build b;
    *out = NULL;
    int rc = build_init(&b, 0, NULL, err);
    if (rc == SH_OK) {
        build_begin_file(&b, &spec);
        rc = copy_surfaces(&b, arrays, err);
    }
    if (rc == SH_OK) rc = build_reserve(&b, arrays->n_vertices, 0, err);
    for (uint32_t i = 0; i < arrays->n_vertices && rc == SH_OK; i++)
        rc = build_vertex(&b, arrays->vertex_m[i], err);
    if (rc == SH_OK) rc = copy_triangles(&b, arrays, err);
    if (rc == SH_OK) {
        b.scene->n_meshes = 1;
        rc = build_end_file(&b, err);
    }
    if (rc == SH_OK) rc = build_finish(&b, 0, out, err);
    build_release(&b);
    return rc;
}

void scene_free(struct scene *scene)
{
    if (scene == NULL) return;
    for (uint32_t i = 0; i < scene->n_copied; i++) {
        scene_free(scene->copied[i].mesh);
        free(scene->copied[i].copy);
    }
    free(scene->copied);
    scene_drop_textures(scene);
    free(scene->vertex_m);
    free(scene->triangle);
    free(scene->label);
    free(scene->surface);
    free(scene->uv);
    free(scene->rgb);
    for (uint32_t i = 0; i < scene->n_masks; i++)
        free(scene->mask[i]);
    free(scene->mask);
    free(scene->cutout);
    free(scene);
}
