/* SPDX-License-Identifier: MIT */
#include "tests/unit/bvh_rig.h"

const double ORIGIN[3] = {10.0, -20.0, 5.0};

struct scene *scene_of(const double (*vertex)[3], uint32_t n_vertices, const uint32_t (*triangle)[3], uint32_t n,
                       const uint16_t *label)
{
    static const struct scene_surface named[2] = {{.object = "small"}, {.object = "large"}};
    return made_scene(&(struct scene_arrays){vertex, n_vertices, triangle, n, label, named, 2});
}
