/* SPDX-License-Identifier: MIT */
/* Tests make scenes of arrays, and cast rays into them. A scene that can't be made is a failure of the test. */
#ifndef TESTS_COMMON_MADE_H
#define TESTS_COMMON_MADE_H

#include "core/bvh.h"
#include "core/scene.h"
#include "tests/common/beam_reference.h"
#include "tests/common/cases.h"

static inline struct scene *made_scene(const struct scene_arrays *arrays)
{
    struct scene *scene = NULL;
    struct sh_err err;
    if (scene_from_arrays(arrays, &scene, &err) != SH_OK) fail_msg("%s", err.text);
    return scene;
}

static inline struct bvh *made_bvh(const struct scene *scene)
{
    struct bvh *bvh = NULL;
    struct sh_err err;
    if (bvh_create(scene, 1, NULL, &bvh, &err) != SH_OK) fail_msg("%s", err.text);
    return bvh;
}

static inline struct bvh_work *made_bvh_work(void)
{
    struct bvh_work *work = NULL;
    struct sh_err err;
    if (bvh_work_create(&work, &err) != SH_OK) fail_msg("%s", err.text);
    return work;
}

/* Makes a door 20 m away, on the left of x = 0, and behind all of it a wall that is deeper by a step. */
static inline struct scene *made_door(double step_m)
{
    const double y = 20.0 + step_m, vertex[8][3] = {{-5, 20, -5}, {0, 20, -5}, {0, 20, 5}, {-5, 20, 5},
                                                    {-5, y, -5},  {5, y, -5},  {5, y, 5},  {-5, y, 5}};
    static const uint32_t triangle[4][3] = {{0, 1, 2}, {0, 2, 3}, {4, 5, 6}, {4, 6, 7}};
    static const uint16_t label[4] = {0, 0, 1, 1};
    static const struct scene_surface surface[2] = {{.object = "door"}, {.object = "wall"}};
    return made_scene(&(struct scene_arrays){vertex, 8, triangle, 4, label, surface, 2});
}

/* A head at the scene's zero, with a beam. */
static inline void made_beam_rig(struct beam_rig *rig, struct scene *scene, const struct beam_view *view)
{
    static const double station_m[3] = {0.0, 0.0, 0.0};
    struct sh_err err;
    if (beam_rig_open(rig, scene, station_m, view, &err) != SH_OK) fail_msg("%s", err.text);
}

#endif
