/* SPDX-License-Identifier: MIT */
/* Tests make scenes of arrays, and cast rays into them. One that can't be made is a failure of the test. */
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

/* A head at the scene's zero, with a beam. */
static inline void made_beam_rig(struct beam_rig *rig, struct scene *scene, const struct beam_view *view)
{
    static const double station_m[3] = {0.0, 0.0, 0.0};
    struct sh_err err;
    if (beam_rig_open(rig, scene, station_m, view, &err) != SH_OK) fail_msg("%s", err.text);
}

#endif
