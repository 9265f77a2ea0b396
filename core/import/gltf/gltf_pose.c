/* SPDX-License-Identifier: MIT */
/* Morph targets with their default weights, and skins with their joints where the nodes are. Both give the pose of a
 * file without its animations.
 *
 *   p     = POSITION + sum of weight * target.POSITION
 *   joint = world of the joint's node * inverse bind matrix
 *   p'    = sum of weight * joint * p         the node of a mesh with a skin moves nothing */
#include "core/import/gltf/gltf_pose.h"

#include <math.h>
#include <stdlib.h>

#include "core/import/gltf/gltf.h"
#include "core/import/gltf/gltf_at.h"
#include "core/import/gltf/gltf_json.h"
#include "core/import/gltf/gltf_nodes.h"

/* ---- morph targets */

/* The node's weights come before the mesh's. */
static int find_weights(struct gltf *g, const json_t *node, const json_t *mesh, json_t **out)
{
    int rc = gltf_list(g, node, "weights", "node", out);
    return rc == SH_OK && *out == NULL ? gltf_list(g, mesh, "weights", "mesh", out) : rc;
}

static int open_target(struct gltf *g, const json_t *target, double weight, const char *at, struct gltf_pose *pose)
{
    struct gltf_target *to = &pose->target[pose->n_targets];
    uint32_t accessor;
    int rc = gltf_index(g, target, "POSITION", at, &accessor);
    if (rc != SH_OK || accessor == GLTF_NONE) return rc;
    rc = gltf_view_open(g, accessor, "VEC3", &to->position);
    if (rc == SH_OK && to->position.count != pose->position.count)
        rc = gltf_fail(g, "%s.POSITION has %u elements for %u vertices", at, to->position.count, pose->position.count);
    to->weight = weight;
    if (rc == SH_OK) pose->n_targets++;
    return rc;
}

static int open_targets(struct gltf *g, const json_t *node, const json_t *mesh, const json_t *primitive, const char *at,
                        struct gltf_pose *pose)
{
    json_t *targets, *weights = NULL;
    int rc = gltf_list(g, primitive, "targets", at, &targets);
    const size_t n = json_array_size(targets);
    if (rc != SH_OK || n == 0) return rc;
    rc = find_weights(g, node, mesh, &weights);
    pose->target = calloc(n, sizeof *pose->target);
    if (pose->target == NULL) return build_fail(g->b, SH_ENOMEM, g->err, "no memory for morph targets");
    for (size_t i = 0; i < n && rc == SH_OK; i++) {
        const double weight = json_number_value(json_array_get(weights, i));
        if (weight != 0.0)
            rc = open_target(g, json_array_get(targets, i), weight, gltf_at("%.70s.targets[%zu]", at, i).text, pose);
    }
    return rc;
}

/* ---- skins */

/* Multiplies the absolute values of two matrices. Rounding to single precision causes an error in proportion to that
 * product. */
static void take_reach(const gltf_matrix world, const gltf_matrix bind, gltf_matrix out)
{
    gltf_matrix a, b;
    for (int i = 0; i < 3; i++)
        for (int k = 0; k < 4; k++) {
            a[i][k] = fabs(world[i][k]);
            b[i][k] = fabs(bind[i][k]);
        }
    gltf_multiply(a, b, out);
}

static int take_joint(struct gltf *g, const json_t *joints, uint32_t i, const struct gltf_view *inverse,
                      struct gltf_pose *pose, const char *at)
{
    gltf_matrix bind = {{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 0}};
    uint32_t node;
    int rc = gltf_node_number(g, joints, i, "joints", at, &node);
    if (rc != SH_OK) return rc;
    for (uint32_t r = 0; r < 3 && inverse->count > 0; r++)
        for (uint32_t c = 0; c < 4; c++)
            bind[r][c] = gltf_value(inverse, i, 4 * c + r);
    const struct gltf_node *joint = &g->node[node];
    gltf_multiply(joint->world, bind, pose->joint[i]);
    take_reach(joint->world, bind, pose->reach[i]);
    pose->has_mirrored = pose->has_mirrored || gltf_is_mirrored(pose->joint[i]);
    return SH_OK;
}

static int open_skin(struct gltf *g, uint32_t number, struct gltf_pose *pose)
{
    const struct gltf_at at = gltf_at("skins[%u]", number);
    json_t *skin, *joints = NULL;
    uint32_t accessor = GLTF_NONE;
    struct gltf_view inverse = {0};
    int rc = gltf_object(g, "skins", number, &skin);
    if (rc == SH_OK) rc = gltf_list(g, skin, "joints", at.text, &joints);
    if (rc == SH_OK) rc = gltf_index(g, skin, "inverseBindMatrices", at.text, &accessor);
    if (rc == SH_OK && accessor != GLTF_NONE) rc = gltf_view_open(g, accessor, "MAT4", &inverse);
    if (rc != SH_OK) return rc;
    pose->n_joints = (uint32_t)json_array_size(joints);
    if (pose->n_joints == 0) return gltf_fail(g, "%s has no joints", at.text);
    if (accessor != GLTF_NONE && inverse.count < pose->n_joints)
        return gltf_fail(g, "%s has %u joints and %u inverse bind matrices", at.text, pose->n_joints, inverse.count);
    pose->joint = malloc(pose->n_joints * sizeof *pose->joint);
    pose->reach = malloc(pose->n_joints * sizeof *pose->reach);
    if (pose->joint == NULL || pose->reach == NULL)
        return build_fail(g->b, SH_ENOMEM, g->err, "no memory for the joints of a skin");
    for (uint32_t i = 0; i < pose->n_joints && rc == SH_OK; i++)
        rc = take_joint(g, joints, i, &inverse, pose, at.text);
    return rc;
}

/* JOINTS_0 and WEIGHTS_0, then further sets of four. */
static int open_sets(struct gltf *g, const json_t *attributes, const char *at, struct gltf_pose *pose)
{
    int rc = SH_OK;
    for (uint32_t i = 0; rc == SH_OK; i++) {
        const struct gltf_at joints = gltf_at("JOINTS_%u", i), weights = gltf_at("WEIGHTS_%u", i);
        uint32_t joint, weight = GLTF_NONE;
        rc = gltf_index(g, attributes, joints.text, at, &joint);
        if (rc == SH_OK) rc = gltf_index(g, attributes, weights.text, at, &weight);
        if (rc != SH_OK || (joint == GLTF_NONE && weight == GLTF_NONE)) break;
        if (i == GLTF_MAX_SETS) return gltf_fail(g, "%s has more than %d sets of joints", at, GLTF_MAX_SETS);
        rc = gltf_view_open(g, joint, "VEC4", &pose->joints[i]);
        if (rc == SH_OK) rc = gltf_view_open(g, weight, "VEC4", &pose->weights[i]);
        if (rc != SH_OK) break;
        if (pose->joints[i].count != pose->position.count || pose->weights[i].count != pose->position.count)
            return gltf_fail(g, "%s: %s and %s differ in number from the vertices", at, joints.text, weights.text);
        pose->n_sets = i + 1;
    }
    return rc;
}

int gltf_pose_open(struct gltf *g, const json_t *node, const json_t *mesh, const json_t *primitive, const char *at,
                   struct gltf_pose *pose)
{
    const json_t *attributes = json_object_get(primitive, "attributes");
    uint32_t position, skin = GLTF_NONE;
    json_t *is_there;
    *pose = (struct gltf_pose){0};
    int rc = gltf_index(g, attributes, "POSITION", at, &position);
    if (rc == SH_OK) rc = gltf_view_open(g, position, "VEC3", &pose->position);
    if (rc == SH_OK) rc = open_targets(g, node, mesh, primitive, at, pose);
    if (rc == SH_OK) rc = gltf_index(g, node, "skin", "node", &skin);
    if (rc == SH_OK && skin != GLTF_NONE) rc = gltf_object(g, "skins", skin, &is_there);
    if (rc == SH_OK && skin != GLTF_NONE) rc = open_sets(g, attributes, at, pose);
    g->n_jointless += rc == SH_OK && skin != GLTF_NONE && pose->n_sets == 0;
    if (rc == SH_OK && pose->n_sets > 0) rc = open_skin(g, skin, pose);
    return rc;
}

void gltf_pose_close(struct gltf_pose *pose)
{
    free(pose->target);
    free(pose->joint);
    free(pose->reach);
}

/* ---- vertices */

static void morph(struct gltf_pose *pose, uint32_t i, double out[3])
{
    for (uint32_t k = 0; k < 3; k++) {
        out[k] = gltf_value(&pose->position, i, k);
        double sum = fabs(out[k]);
        for (size_t t = 0; t < pose->n_targets; t++) {
            const double move = pose->target[t].weight * gltf_value(&pose->target[t].position, i, k);
            out[k] += move;
            sum += fabs(move);
        }
        if (sum > pose->most[k]) pose->most[k] = sum;
    }
}

/* Adds the weighted image of p by a joint. */
static void add_joint(const struct gltf_pose *pose, uint32_t joint, double weight, const double p[3], double moved[3],
                      double reach[3])
{
    const double size[3] = {fabs(p[0]), fabs(p[1]), fabs(p[2])};
    double at[3], far[3];
    gltf_apply(pose->joint[joint], p, at);
    gltf_apply(pose->reach[joint], size, far);
    for (int k = 0; k < 3; k++) {
        moved[k] += weight * at[k];
        reach[k] += fabs(weight) * far[k];
    }
}

/* The sum of weights is 1 up to rounding, which the division removes. */
static int bend(struct gltf *g, struct gltf_pose *pose, uint32_t i, double p[3])
{
    double sum = 0.0, moved[3] = {0, 0, 0}, reach[3] = {0, 0, 0};
    for (uint32_t s = 0; s < 4 * pose->n_sets; s++) {
        const double weight = gltf_value(&pose->weights[s / 4], i, s % 4);
        const double joint = gltf_value(&pose->joints[s / 4], i, s % 4);
        if (weight == 0.0) continue;
        if (!(joint >= 0.0 && joint < pose->n_joints))
            return gltf_fail(g, "vertex %u has joint %g; its skin has %u", i, joint, pose->n_joints);
        add_joint(pose, (uint32_t)joint, weight, p, moved, reach);
        sum += weight;
    }
    if (!(fabs(sum) > 1e-3)) {
        g->n_unweighted++;
        return SH_OK;
    }
    for (int k = 0; k < 3; k++) {
        p[k] = moved[k] / sum;
        pose->most_bent = fmax(pose->most_bent, reach[k] / fabs(sum));
    }
    return SH_OK;
}

int gltf_pose_vertex(struct gltf *g, struct gltf_pose *pose, uint32_t i, double out[3])
{
    morph(pose, i, out);
    return pose->joint != NULL ? bend(g, pose, i, out) : SH_OK;
}

/* A vertex that no joint moves is not mirrored. bend() has checked the numbers of joints whose weight is not 0. */
bool gltf_pose_is_mirrored(const struct gltf_pose *pose, const gltf_matrix world, uint32_t i)
{
    double most = 0.0;
    bool is_mirrored = false;
    if (pose->joint == NULL) return gltf_is_mirrored(world);
    for (uint32_t s = 0; s < 4 * pose->n_sets && pose->has_mirrored; s++) {
        const double weight = gltf_value(&pose->weights[s / 4], i, s % 4);
        if (!(weight > most)) continue;
        most = weight;
        is_mirrored = gltf_is_mirrored(pose->joint[(uint32_t)gltf_value(&pose->joints[s / 4], i, s % 4)]);
    }
    return is_mirrored;
}

/* ---- their error */

static double place_error(const gltf_matrix m, const double error[3])
{
    double most = 0.0;
    for (int i = 0; i < 3; i++)
        most = fmax(most, fabs(m[i][0]) * error[0] + fabs(m[i][1]) * error[1] + fabs(m[i][2]) * error[2]);
    return most;
}

/* The error of positions and targets that are whole numbers: half a step each. */
static double half_step(const struct gltf_pose *pose)
{
    double half = 0.5 * gltf_step(&pose->position);
    for (size_t t = 0; t < pose->n_targets; t++)
        half += 0.5 * fabs(pose->target[t].weight) * gltf_step(&pose->target[t].position);
    return half;
}

void gltf_pose_error(struct gltf *g, const struct gltf_pose *pose, const gltf_matrix world)
{
    const double half = half_step(pose), steps[3] = {half, half, half};
    /* Twice: positions are rounded, and so are inverse bind matrices. */
    const double bent = 2.0 * BUILD_SINGLE_ROUNDING * pose->most_bent;
    double error[3];
    for (uint32_t j = 0; j < pose->n_joints; j++)
        g->step_error = fmax(g->step_error, place_error(pose->joint[j], steps));
    if (pose->joint == NULL) g->step_error = fmax(g->step_error, place_error(world, steps));
    if (pose->position.component != GLTF_F32) return;
    for (int k = 0; k < 3; k++) {
        error[k] = BUILD_SINGLE_ROUNDING * pose->most[k];
        g->largest = fmax(g->largest, pose->most[k]);
    }
    g->error = fmax(g->error, pose->joint != NULL ? bent : place_error(world, error));
}
