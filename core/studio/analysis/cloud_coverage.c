/* SPDX-License-Identifier: MIT */
#include <stdlib.h>

#include "core/studio/cloud.h"

uint16_t cloud_surface(const struct cloud *cloud, const struct scene *scene, const uint32_t *triangle, size_t i)
{
    if (cloud->label != NULL) return cloud->label[i];
    return triangle[i] != CLOUD_TRIANGLE_NONE ? scene->label[triangle[i]] : CLOUD_LABEL_NONE;
}

int cloud_cover(const struct cloud *cloud, const struct scene *scene, uint32_t n_surfaces, const uint32_t *triangle,
                struct cloud_coverage *out, struct sh_err *err)
{
    *out = (struct cloud_coverage){0};
    /* One block: a flag per surface, then one per triangle. */
    uint8_t *surface_hit = calloc((size_t)n_surfaces + scene->n_triangles, 1);
    if (surface_hit == NULL) return sh_fail(err, SH_ENOMEM, "no memory for the coverage");
    uint8_t *triangle_hit = surface_hit + n_surfaces;
    int rc = SH_OK;
    for (size_t i = 0; i < cloud->n && rc == SH_OK; i++) {
        uint16_t label = cloud_surface(cloud, scene, triangle, i);
        if (label != CLOUD_LABEL_NONE && label >= n_surfaces) {
            rc = sh_fail(err, SH_EINPUT, "point %zu has label %u; the scene has %u surfaces, from 0", i + 1, label,
                         n_surfaces);
        } else if (label != CLOUD_LABEL_NONE && !surface_hit[label]) {
            surface_hit[label] = 1;
            out->surfaces_hit++;
        }
        if (triangle[i] != CLOUD_TRIANGLE_NONE && !triangle_hit[triangle[i]]) {
            triangle_hit[triangle[i]] = 1;
            out->triangles_hit++;
        }
    }
    free(surface_hit);
    return rc;
}
