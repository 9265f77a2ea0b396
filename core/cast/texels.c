/* Where on a texture rays have met it. */
#include <math.h>

#include "core/cast/caster_private.h"
#include "core/surface.h"

void caster_texels(const struct cast_setup *s, const struct met *met)
{
    const struct bvh_rays *rays = &met->rays;
    const struct surface_table *table = s->detect != NULL ? s->detect->surfaces : NULL;
    if (table == NULL || table->texture == NULL) return;
    for (uint32_t i = 0; i < rays->n; i++) {
        if (isnan(rays->range_m[i]) || rays->label[i] >= table->n || table->texture[rays->label[i]] == NULL) continue;
        const struct cast_mover *m = met->body != NULL && met->body[i] != 0 ? &s->mover[met->body[i] - 1] : NULL;
        const struct scene *scene = bvh_scene(m != NULL ? m->bvh : s->bvh);
        if (scene->uv == NULL) continue;
        const double d[3] = VEC3_AT(rays->dir, i);
        double at[3], p[3], uv[2];
        bvh_origin_of(&rays->from, i, at);
        for (int k = 0; k < 3; k++)
            at[k] += rays->range_m[i] * d[k];
        for (int k = 0; k < 3; k++) /* where that was at rest */
            p[k] = m == NULL ? at[k]
                             : m->rotation[k] * (at[0] - m->shift_m[0]) + m->rotation[3 + k] * (at[1] - m->shift_m[1]) +
                                   m->rotation[6 + k] * (at[2] - m->shift_m[2]);
        const uint32_t *corner = scene->triangle[rays->triangle[i]];
        const double *const vertex[3] = {scene->vertex_m[corner[0]], scene->vertex_m[corner[1]],
                                         scene->vertex_m[corner[2]]};
        scene_uv_at(scene, rays->triangle[i], vertex, p, uv);
        if (isfinite(uv[0]) && isfinite(uv[1])) rays->label[i] = surface_texel(table, rays->label[i], uv);
    }
}
