/* Where on a texture rays have met it. */
#include <math.h>

#include "core/cast/caster_private.h"
#include "core/surface.h"

/* Of what ray i has met. 0: there are none. */
static int uv_of(const struct cast_setup *s, const struct met *met, uint32_t i, double uv[2])
{
    const struct bvh_rays *rays = &met->rays;
    const struct cast_mover *m = met->body != NULL && met->body[i] != 0 ? caster_body(s, met->body[i]) : NULL;
    struct scene_part part;
    scene_find_part(bvh_scene(m != NULL ? m->bvh : s->bvh), rays->triangle[i], &part);
    const struct scene *scene = part.scene;
    if (scene->uv == NULL) return 0;
    const double d[3] = VEC3_AT(rays->dir, i);
    double at[3], p[3];
    bvh_origin_of(&rays->from, i, at);
    for (int k = 0; k < 3; k++)
        at[k] += rays->range_m[i] * d[k];
    for (int k = 0; k < 3; k++) /* where that was at rest */
        p[k] = m == NULL ? at[k]
                         : m->rotation[k] * (at[0] - m->shift_m[0]) + m->rotation[3 + k] * (at[1] - m->shift_m[1]) +
                               m->rotation[6 + k] * (at[2] - m->shift_m[2]);
    if (part.copy != NULL) scene_copy_put_back(part.copy, ((const double[3]){p[0], p[1], p[2]}), p);
    const uint32_t *corner = scene->triangle[part.triangle];
    const double *const vertex[3] = {scene->vertex_m[corner[0]], scene->vertex_m[corner[1]],
                                     scene->vertex_m[corner[2]]};
    scene_uv_at(scene, part.triangle, vertex, p, uv);
    return isfinite(uv[0]) && isfinite(uv[1]);
}

static void set_reflectances(const struct cast_setup *s, const struct met *met, const struct surface_table *table)
{
    const struct bvh_rays *rays = &met->rays;
    double uv[2];
    for (uint32_t i = 0; i < rays->n; i++) {
        if (isnan(rays->range_m[i]) || rays->label[i] >= table->n || table->texture[rays->label[i]] == NULL) continue;
        if (uv_of(s, met, i, uv)) rays->label[i] = surface_texel(table, rays->label[i], uv);
    }
}

static void set_colours(const struct cast_setup *s, const struct met *met, const struct surface_colours *colours)
{
    const struct bvh_rays *rays = &met->rays;
    double uv[2];
    for (uint32_t i = 0; i < rays->n; i++) {
        const uint32_t label = surface_of_label(rays->label[i]);
        if (isnan(rays->range_m[i])) continue;
        const int has_image = label < colours->n && colours->image[label] != NULL;
        met->colour[i] = surface_colour(colours, label, has_image && uv_of(s, met, i, uv) ? uv : NULL);
    }
}

void caster_texels(const struct cast_setup *s, const struct met *met)
{
    const struct surface_table *table = s->detect != NULL ? s->detect->surfaces : NULL;
    if (table != NULL && table->texture != NULL) set_reflectances(s, met, table);
    if (met->colour != NULL) set_colours(s, met, s->colour->surfaces);
}
