/* SPDX-License-Identifier: MIT */
/* The place on a texture, or between vertices, where rays have hit a mesh. */
#include "core/cast/texels.h"

#include <math.h>
#include <string.h>

#include "core/cast/nearest.h"
#include "core/mat3.h"
#include "core/surface.h"

/* The place of ray i's hit in a mesh, at rest. */
struct place {
    const struct scene *scene;
    uint32_t triangle;
    const double *corner[3];
    double p[3];
};

static void find_place(const struct cast_setup *s, const struct ray_hits *hits, uint32_t i, struct place *place)
{
    const struct bvh_rays *rays = &hits->rays;
    const struct cast_mover *m = hits->body != NULL && hits->body[i] != 0 ? caster_body(s, hits->body[i]) : NULL;
    struct scene_part part;
    scene_find_part(bvh_scene(m != NULL ? m->bvh : s->bvh), rays->triangle[i], &part);
    place->scene = part.scene;
    place->triangle = part.triangle;
    if (part.scene->uv == NULL && part.scene->rgb == NULL) return;
    const double d[3] = VEC3_AT(rays->dir, i);
    double at[3], *p = place->p;
    bvh_origin_of(&rays->from, i, at);
    for (int k = 0; k < 3; k++)
        at[k] += rays->range_m[i] * d[k];
    memcpy(p, at, sizeof at);
    if (m != NULL) { /* the place on the body at rest */
        vec3_sub(at, m->shift_m, at);
        mat3_apply_transposed(m->rotation, at, p);
    }
    if (part.copy != NULL) scene_copy_put_back(part.copy, ((const double[3]){p[0], p[1], p[2]}), p);
    for (int c = 0; c < 3; c++)
        place->corner[c] = part.scene->vertex_m[part.scene->triangle[part.triangle][c]];
}

/* Returns 0 where the mesh has no texture coordinates, or where they are not finite. */
static int uv_of(const struct place *place, double uv[2])
{
    if (place->scene->uv == NULL) return 0;
    scene_uv_at(place->scene, place->triangle, place->corner, place->p, uv);
    return isfinite(uv[0]) && isfinite(uv[1]);
}

static int rgb_of(const struct place *place, uint8_t rgb[3])
{
    return place->scene->rgb != NULL && scene_rgb_at(place->scene, place->triangle, place->corner, place->p, rgb);
}

static void set_reflectances(const struct cast_setup *s, const struct ray_hits *hits, const struct surface_table *table)
{
    const struct bvh_rays *rays = &hits->rays;
    struct place place;
    double uv[2];
    uint8_t rgb[3];
    for (uint32_t i = 0; i < rays->n; i++) {
        const uint32_t label = rays->label[i];
        if (isnan(rays->range_m[i]) || label >= table->n) continue;
        const int has_image = table->texture != NULL && table->texture[label] != NULL;
        const int by_vertex = table->by_vertex != NULL && table->by_vertex[label];
        if (!has_image && !by_vertex) continue;
        find_place(s, hits, i, &place);
        if (has_image && uv_of(&place, uv)) rays->label[i] = surface_texel(table, label, uv);
        if (by_vertex && rays->label[i] == label && rgb_of(&place, rgb)) rays->label[i] = surface_texel_of(label, rgb);
    }
}

static void set_colours(const struct cast_setup *s, const struct ray_hits *hits, const struct surface_colours *colours)
{
    const struct bvh_rays *rays = &hits->rays;
    struct place place;
    double uv[2];
    uint8_t rgb[3];
    for (uint32_t i = 0; i < rays->n; i++) {
        const uint32_t label = surface_of_label(rays->label[i]);
        if (isnan(rays->range_m[i])) continue;
        const int has_image = label < colours->n && colours->image[label] != NULL;
        const int by_vertex = label < colours->n && colours->by_vertex[label];
        if (has_image || by_vertex) find_place(s, hits, i, &place);
        hits->colour[i] = surface_colour(colours, label, has_image && uv_of(&place, uv) ? uv : NULL,
                                         by_vertex && rgb_of(&place, rgb) ? rgb : NULL);
    }
}

void caster_texels(const struct cast_setup *s, const struct ray_hits *hits)
{
    const struct surface_table *table = s->detect != NULL ? s->detect->surfaces : NULL;
    if (table != NULL && (table->texture != NULL || table->by_vertex != NULL)) set_reflectances(s, hits, table);
    if (hits->colour != NULL) set_colours(s, hits, s->colour->surfaces);
}
