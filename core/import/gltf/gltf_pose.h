/* SPDX-License-Identifier: MIT */
/* This finds where a mesh's vertices are once morph targets and joints have moved them. */
#ifndef CORE_IMPORT_GLTF_GLTF_POSE_H
#define CORE_IMPORT_GLTF_GLTF_POSE_H

#include <jansson.h>

#include "core/import/gltf/gltf_accessor.h"
#include "core/import/gltf/gltf_matrix.h"

enum { GLTF_MAX_SETS = 8 };

struct gltf_target {
    struct gltf_view position;
    double weight;
};

struct gltf_pose {
    struct gltf_view position;
    struct gltf_target *target; /* those with an effect */
    size_t n_targets;
    gltf_matrix *joint, *reach; /* [n_joints] NULL: no skin. reach: as joint, but made of absolute values */
    uint32_t n_joints;
    bool has_mirrored; /* some joint is mirrored */
    struct gltf_view joints[GLTF_MAX_SETS], weights[GLTF_MAX_SETS];
    uint32_t n_sets;
    double most[3];   /* largest sum of |terms| of a position before joints move it, per axis */
    double most_bent; /* the same after joints have moved it */
};
int gltf_pose_open(struct gltf *g, const json_t *node, const json_t *mesh, const json_t *primitive, const char *at,
                   struct gltf_pose *pose);
/* Vertex i < position.count, in the frame of the node, or of the scene where there is a skin. */
int gltf_pose_vertex(struct gltf *g, struct gltf_pose *pose, uint32_t i, double out[3]);
/* Whether what places vertex i is mirrored: `world`, or where there is a skin, the joint of its largest weight. */
bool gltf_pose_is_mirrored(const struct gltf_pose *pose, const gltf_matrix world, uint32_t i);
/* Raises g->error and g->step_error to the largest errors of these vertices once `world`, or joints, have placed them.
 * Where POSITION is in single precision, it also raises g->largest to the largest of pose->most. */
void gltf_pose_error(struct gltf *g, const struct gltf_pose *pose, const gltf_matrix world);
void gltf_pose_close(struct gltf_pose *pose);

#endif
