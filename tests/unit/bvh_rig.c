/* SPDX-License-Identifier: MIT */
#include "tests/unit/bvh_rig.h"

const double ORIGIN[3] = {10.0, -20.0, 5.0};

struct scene *scene_of(const double (*vertex)[3], uint32_t n_vertices, const uint32_t (*triangle)[3], uint32_t n,
                       const uint16_t *label)
{
    static const struct scene_surface named[2] = {{.object = "small"}, {.object = "large"}};
    struct scene *scene;
    struct sh_err err;
    if (scene_from_arrays(&(struct scene_arrays){vertex, n_vertices, triangle, n, label, named, 2}, &scene, &err) != 0)
        fail_msg("%s", err.text);
    return scene;
}

struct bvh *bvh_of(const struct scene *scene)
{
    struct bvh *bvh;
    struct sh_err err;
    if (bvh_create(scene, 1, NULL, &bvh, &err) != 0) fail_msg("%s", err.text);
    return bvh;
}
