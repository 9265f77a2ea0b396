/* SPDX-License-Identifier: MIT */
/* A mesh that stands in a scene many times: its triangles are kept once, or written out for each of its places. */
#include "core/scene/copies.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/angle.h"
#include "core/grow.h"
#include "core/scene/hull.h"
#include "core/vec3.h"

void scene_find_part(const struct scene *scene, uint32_t triangle, struct scene_part *part)
{
    *part = (struct scene_part){.scene = scene, .triangle = triangle};
    if (triangle < scene->n_triangles) return;
    uint32_t i = 0;
    while (i + 1 < scene->n_copied && triangle >= scene->copied[i + 1].first)
        i++;
    const struct scene_copied *c = &scene->copied[i];
    const uint32_t at = triangle - c->first;
    part->scene = c->mesh;
    part->copy = &c->copy[at / c->mesh->n_triangles];
    part->triangle = at % c->mesh->n_triangles;
    part->copied = i;
}

uint32_t scene_label(const struct scene *scene, uint32_t triangle)
{
    struct scene_part part;
    if (triangle < scene->n_triangles) return scene->label[triangle];
    scene_find_part(scene, triangle, &part);
    return scene->label0 + part.copy->label0 + part.scene->label[part.triangle];
}

void scene_corners(const struct scene *scene, uint32_t triangle, double corner[3][3])
{
    struct scene_part part;
    scene_find_part(scene, triangle, &part);
    for (int i = 0; i < 3; i++) {
        const double *v = part.scene->vertex_m[part.scene->triangle[part.triangle][i]];
        if (part.copy != NULL)
            scene_copy_put(part.copy, v, corner[i]);
        else
            memcpy(corner[i], v, sizeof corner[i]);
    }
}

uint64_t scene_n_kept(const struct scene *scene)
{
    uint64_t n = scene->n_triangles;
    for (uint32_t i = 0; i < scene->n_copied; i++)
        n += scene->copied[i].mesh->n_triangles;
    return n;
}

/* ---- surfaces and textures */

/* "OBJECT 17": the number always has room. */
static void name_object(char object[SCENE_NAME_LEN], size_t number)
{
    char tail[24], name[SCENE_NAME_LEN];
    const size_t len = (size_t)snprintf(tail, sizeof tail, " %zu", number);
    scene_copy_name(name, SCENE_NAME_LEN - len, object, strlen(object));
    const size_t end = strlen(name);
    memcpy(object, name, end);
    memcpy(object + end, tail, len + 1);
}

/* Adds the mesh's surfaces and textures after the scene's. sets: how many times each surface is added. */
static int add_surfaces(struct scene *scene, struct scene *mesh, const struct scene_places *places, struct sh_err *err)
{
    const size_t sets = places->own_surfaces ? places->n : 1, n = sets * mesh->n_surfaces;
    if (n > SCENE_MAX_SURFACES - scene->n_surfaces)
        return sh_fail(
            err, SH_EINPUT,
            "%s: %zu copies with %u surfaces each are too many: a scene holds up to %d, and has %u; allowed are copies "
            "without surfaces of their own (copy_labels: off)",
            places->says, places->n, mesh->n_surfaces, SCENE_MAX_SURFACES, scene->n_surfaces);
    if (!resize(&scene->surface, scene->n_surfaces + n, sizeof *scene->surface) ||
        !resize(&scene->texture, (size_t)scene->n_textures + mesh->n_textures, sizeof *scene->texture) ||
        (scene->cutout != NULL && !resize(&scene->cutout, scene->n_surfaces + n, sizeof(const struct texture_mask *))))
        return sh_fail(err, SH_ENOMEM, "no memory for the scene's surfaces");
    if (scene->n_textures + mesh->n_textures > UINT16_MAX)
        return sh_fail(err, SH_EINPUT, "%s: too many textures: a scene holds up to %d", places->says, UINT16_MAX);
    if (scene->cutout != NULL) /* the mesh has its own */
        memset(scene->cutout + scene->n_surfaces, 0, n * sizeof(const struct texture_mask *));
    for (size_t i = 0; i < n; i++) {
        struct scene_surface *to = &scene->surface[scene->n_surfaces + i];
        *to = mesh->surface[i % mesh->n_surfaces];
        to->texture = (uint16_t)(to->texture != 0 ? to->texture + scene->n_textures : 0);
        to->opacity = (uint16_t)(to->opacity != 0 ? to->opacity + scene->n_textures : 0);
        if (places->own_surfaces) name_object(to->object, i / mesh->n_surfaces + 1);
    }
    scene->n_surfaces += (uint32_t)n;
    if (mesh->n_textures > 0)
        memcpy(scene->texture + scene->n_textures, mesh->texture, mesh->n_textures * sizeof *mesh->texture);
    scene->n_textures += mesh->n_textures;
    mesh->n_textures = 0;
    return SH_OK;
}

/* ---- places */

static int check_copy(const struct scene_places *places, size_t i, const struct scene_copy *copy, struct sh_err *err)
{
    for (int k = 0; k < 3; k++)
        if (!(fabs(copy->min_m[k]) <= SCENE_MAX_COORDINATE_M && fabs(copy->max_m[k]) <= SCENE_MAX_COORDINATE_M))
            return sh_fail(
                err, SH_EINPUT,
                "%s: copy %zu goes from %g to %g m; allowed are coordinates up to %g m: check its place and its scale "
                "of %g",
                places->says, i + 1, copy->min_m[k], copy->max_m[k], SCENE_MAX_COORDINATE_M, copy->scale);
    return SH_OK;
}

/* The copies' labels are those that add_surfaces will give next. */
static int set_copies(struct scene *scene, const struct scene *mesh, const struct scene_places *places,
                      const struct sh_report *report, struct scene_copy *copy, struct sh_err *err)
{
    const uint32_t own = places->own_surfaces ? mesh->n_surfaces : 0;
    for (size_t i = 0; i < places->n; i++) {
        const struct scene_place *place = &places->place[i];
        const double turn = angle_rad(fmod(place->turn_deg, 360.0));
        copy[i] = (struct scene_copy){.scale = place->scale,
                                      .cosine = cos(turn),
                                      .sine = sin(turn),
                                      .label0 = scene->n_surfaces + (uint32_t)i * own};
        memcpy(copy[i].shift_m, place->at_m, sizeof copy[i].shift_m);
    }
    int rc = scene_bound_copies(scene, mesh, copy, places->n, report, err);
    for (size_t i = 0; i < places->n && rc == SH_OK; i++)
        rc = check_copy(places, i, &copy[i], err);
    return rc;
}

static void keep_counts(struct scene *scene, const struct scene *mesh, const struct scene_copy *copy, size_t n)
{
    for (size_t i = 0; i < n; i++)
        scene->error_m = fmax(scene->error_m, mesh->error_m * copy[i].scale);
    scene->n_meshes += (uint32_t)n;
    scene->counts.zero_area += mesh->counts.zero_area;
    scene->counts.not_triangles += mesh->counts.not_triangles;
    scene->counts.names_cut += mesh->counts.names_cut;
    scene->says = mesh->says;
}

/* The scene owns mesh and copies from here on. */
static int keep_copies(struct scene *scene, struct scene *mesh, struct scene_copy *copy, size_t n, struct sh_err *err)
{
    if (!resize(&scene->copied, (size_t)scene->n_copied + 1, sizeof *scene->copied))
        return sh_fail(err, SH_ENOMEM, "no memory for copies");
    scene->copied[scene->n_copied++] =
        (struct scene_copied){.mesh = mesh, .copy = copy, .n = (uint32_t)n, .first = scene->n_all};
    scene->n_copies += (uint32_t)n;
    scene->n_all += (uint32_t)n * mesh->n_triangles;
    return SH_OK;
}

int scene_add_copies(struct scene *scene, struct scene *mesh, const struct scene_places *places,
                     const struct sh_report *report, struct sh_err *err)
{
    if (places->n > (UINT32_MAX - 1 - scene->n_all) / mesh->n_triangles)
        return sh_fail(err, SH_EINPUT,
                       "%s: %zu copies of %u triangles are too many: a scene holds up to %u triangles with those of "
                       "copies, and has %u",
                       places->says, places->n, mesh->n_triangles, UINT32_MAX - 1, scene->n_all);
    struct scene_copy *copy = calloc(places->n + 1, sizeof *copy);
    int rc = copy != NULL ? SH_OK : sh_fail(err, SH_ENOMEM, "no memory for %zu copies", places->n);
    if (rc == SH_OK) rc = set_copies(scene, mesh, places, report, copy, err);
    if (rc == SH_OK) rc = add_surfaces(scene, mesh, places, err);
    if (rc == SH_OK) keep_counts(scene, mesh, copy, places->n);
    if (rc == SH_OK) rc = keep_copies(scene, mesh, copy, places->n, err);
    if (rc != SH_OK) free(copy);
    return rc;
}
