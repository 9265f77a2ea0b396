/* SPDX-License-Identifier: MIT */
/* Area, volume, box, and whether a body is closed: core/body.h over all its edges. */
#include <string.h>

#include "core/body.h"
#include "core/import/ifc/ifc_bodies.h"
#include "core/vec3.h"

#define CLOSED_SHARE 1e-5 /* of the area; rounding leaves 1e-7, and a missing face larger than this share is found */

static void box_of(const struct ifc_part *part, size_t n_parts, struct ifc_figures *f)
{
    vec3_bound_nothing(f->min_m, f->max_m);
    for (size_t i = 0; i < n_parts; i++)
        for (uint32_t t = 0; t < part[i].n_triangles; t++)
            for (int c = 0; c < 3; c++)
                vec3_bound(f->min_m, f->max_m, part[i].vertex_m[part[i].triangle[t][c]]);
}

void ifc_figures(const struct ifc_part *part, size_t n_parts, struct ifc_figures *f)
{
    struct body_sum sum;
    *f = (struct ifc_figures){0};
    box_of(part, n_parts, f);
    if (!(f->min_m[0] <= f->max_m[0])) {
        memset(f, 0, sizeof *f);
        return;
    }
    body_begin(&sum, f->min_m, f->max_m);
    for (size_t i = 0; i < n_parts; i++)
        for (uint32_t t = 0; t < part[i].n_triangles; t++) {
            double corner[3][3];
            for (int c = 0; c < 3; c++)
                memcpy(corner[c], part[i].vertex_m[part[i].triangle[t][c]], sizeof corner[c]);
            body_add_triangle(&sum, (const double(*)[3])corner);
            for (int c = 0; c < 3; c++)
                body_add_edge(&sum, corner[c], corner[(c + 1) % 3]);
        }
    f->area_m2 = sum.area_m2;
    f->volume_m3 = sum.volume_m3;
    f->open_m2 = body_open_m2(&sum);
}

bool ifc_is_closed(const struct ifc_figures *f)
{
    return f->area_m2 > 0.0 && f->open_m2 <= CLOSED_SHARE * f->area_m2;
}
