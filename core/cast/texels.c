/* Where on a texture rays have met it. */
#include <math.h>

#include "core/cast/caster_private.h"
#include "core/surface.h"

/* Barycentric coordinates of p, on the triangle's plane, by the areas seen along the largest axis of its
 * normal. */
static void weights(const double *a, const double *b, const double *c, const double p[3], double w[3])
{
    double u[3], v[3], n[3];
    vec3_sub(b, a, u);
    vec3_sub(c, a, v);
    vec3_cross(u, v, n);
    int along = fabs(n[0]) > fabs(n[1]) ? 0 : 1;
    if (fabs(n[2]) > fabs(n[along])) along = 2;
    int x = (along + 1) % 3, y = (along + 2) % 3;
    double qx = p[x] - a[x], qy = p[y] - a[y];
    w[1] = (qx * v[y] - qy * v[x]) / n[along];
    w[2] = (u[x] * qy - u[y] * qx) / n[along];
    w[0] = 1.0 - w[1] - w[2];
}

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
        double at[3], p[3], w[3], uv[2] = {0.0, 0.0};
        bvh_origin_of(&rays->from, i, at);
        for (int k = 0; k < 3; k++)
            at[k] += rays->range_m[i] * d[k];
        for (int k = 0; k < 3; k++) /* where that was at rest */
            p[k] = m == NULL ? at[k]
                             : m->rotation[k] * (at[0] - m->shift_m[0]) + m->rotation[3 + k] * (at[1] - m->shift_m[1]) +
                                   m->rotation[6 + k] * (at[2] - m->shift_m[2]);
        const uint32_t *corner = scene->triangle[rays->triangle[i]];
        weights(scene->vertex_m[corner[0]], scene->vertex_m[corner[1]], scene->vertex_m[corner[2]], p, w);
        for (int c = 0; c < 3; c++)
            for (int k = 0; k < 2; k++)
                uv[k] += w[c] * (double)scene->uv[rays->triangle[i]][c][k];
        if (isfinite(uv[0]) && isfinite(uv[1])) rays->label[i] = surface_texel(table, rays->label[i], uv);
    }
}
