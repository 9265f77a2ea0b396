/* SPDX-License-Identifier: MIT */
/* Keeps the latest poses of a moving head, and converts points from the head's frame to the scene's by them. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/mat3.h"
#include "core/quat.h"
#include "core/vec3.h"
#include "drivers/host/host.h"

/* Room for some seconds, and for the longest frame. */
enum { KEEP = 8192 };
_Static_assert(KEEP > 2 * NATIVE_MAX_POSES, "two frames have room");

struct host_poses {
    uint64_t n; /* how many came; the last KEEP are kept, number i at at[i % KEEP] */
    struct {
        struct native_pose pose;
        int begins; /* 1: first of its stream frame; between it and the pose before, the head's motion is not known */
    } at[KEEP];
};

void host_forget_poses(struct scanhead *sh)
{
    if (sh->poses != NULL) sh->poses->n = 0;
}

int host_absorb_poses(struct scanhead *sh, const uint8_t *payload, size_t len)
{
    uint32_t n;
    if (native_decode_poses(payload, len, &n) != 0) return SH_EFORMAT;
    if (sh->poses == NULL) sh->poses = calloc(1, sizeof *sh->poses);
    if (sh->poses == NULL) return SH_ENOMEM;
    for (uint32_t i = 0; i < n; i++) {
        uint64_t at = sh->poses->n++ % KEEP;
        native_decode_pose(payload, i, &sh->poses->at[at].pose);
        sh->poses->at[at].begins = i == 0;
    }
    return 0;
}

/* The motion from pose a to pose b: the rotation at a, and the axis (in SOCS, the head's frame) and angle of the turn
 * from there. */
struct leg {
    const struct native_pose *a, *b;
    double rotation[9], axis[3], angle_rad;
};

static void set_leg(struct leg *leg, const struct native_pose *a, const struct native_pose *b)
{
    leg->a = a;
    leg->b = b;
    quat_turn(a->quat, b->quat, leg->axis, &leg->angle_rad);
    quat_matrix(a->quat, leg->rotation);
}

/* Finds the latest two poses of one stream frame with t_ns between them; 0 where there are none. */
static int find_leg(const struct host_poses *poses, int64_t t_ns, struct leg *leg)
{
    uint64_t n = poses != NULL ? poses->n : 0, first = n > KEEP ? n - KEEP : 0;
    for (uint64_t i = n; i > first + 1; i--) {
        const struct native_pose *a = &poses->at[(i - 2) % KEEP].pose, *b = &poses->at[(i - 1) % KEEP].pose;
        if (poses->at[(i - 1) % KEEP].begins || t_ns < a->t_ns || t_ns > b->t_ns) continue;
        set_leg(leg, a, b);
        return 1;
    }
    return 0;
}

static double fraction(const struct leg *leg, int64_t t_ns)
{
    /* without signs: poses of a broken stream may be further apart than 63 bits */
    const uint64_t a_ns = (uint64_t)leg->a->t_ns;
    return (double)((uint64_t)t_ns - a_ns) / (double)((uint64_t)leg->b->t_ns - a_ns);
}

int scanhead_pose(struct scanhead *sh, int64_t t_ns, struct scanhead_pose *pose)
{
    struct leg leg;
    memset(pose, 0, sizeof *pose);
    if (!find_leg(sh->poses, t_ns, &leg))
        return sh_fail(&sh->err, SCANHEAD_ESTATE, "%s: there is no pose of the head at %.9f s of the scan",
                       sh->source.name, 1e-9 * (double)t_ns);
    const struct native_pose *a = leg.a, *b = leg.b;
    double f = fraction(&leg, t_ns), s = sin(0.5 * f * leg.angle_rad);
    const double turn[4] = {cos(0.5 * f * leg.angle_rad), s * leg.axis[0], s * leg.axis[1], s * leg.axis[2]};
    quat_multiply(a->quat, turn, pose->quat);
    for (int i = 0; i < 3; i++)
        pose->position_m[i] = a->position_m[i] + f * (b->position_m[i] - a->position_m[i]);
    pose->t_ns = t_ns;
    pose->frame = a->frame + f * (b->frame - a->frame);
    pose->flags = (int)(a->flags | b->flags);
    return SCANHEAD_OK;
}

int scanhead_poses(struct scanhead *sh, const struct scanhead_frame *frame, uint32_t first, struct scanhead_pose *poses,
                   uint32_t max)
{
    uint32_t n, i = 0;
    int rc = host_check_last(sh, frame, SCANHEAD_POSES);
    if (rc != 0) return rc;
    if (native_decode_poses(frame->payload, frame->payload_len, &n) != 0) return SCANHEAD_EFORMAT;
    for (; i < max && first + i < n; i++) {
        struct native_pose p;
        native_decode_pose(frame->payload, first + i, &p);
        poses[i] = (struct scanhead_pose){.t_ns = p.t_ns, .frame = p.frame, .flags = (int)p.flags};
        memcpy(poses[i].position_m, p.position_m, sizeof p.position_m);
        memcpy(poses[i].quat, p.quat, sizeof p.quat);
    }
    return (int)i;
}

/* Sets the point's coordinates in the scene from v, its coordinates in the head's frame SOCS. */
static void place(const double rotation[9], const double at[3], const double v[3], struct scanhead_point *p)
{
    double turned[3];
    mat3_apply(rotation, v, turned);
    p->x = at[0] + turned[0];
    p->y = at[1] + turned[1];
    p->z = at[2] + turned[2];
}

/* Turns the point by Rodrigues' formula in the head's frame SOCS, then by the rotation at the leg's begin. */
static void place_moving(const struct leg *leg, double f, struct scanhead_point *p)
{
    const double angle = f * leg->angle_rad, s = sin(angle), versine = 1 - cos(angle);
    double v[3] = {p->x, p->y, p->z}, u[3], w[3], at[3];
    vec3_cross(leg->axis, v, u);
    vec3_cross(leg->axis, u, w);
    for (int i = 0; i < 3; i++) {
        v[i] += s * u[i] + versine * w[i];
        at[i] = leg->a->position_m[i] + f * (leg->b->position_m[i] - leg->a->position_m[i]);
    }
    place(leg->rotation, at, v, p);
}

static int to_scene_moving(struct scanhead *sh, struct scanhead_point *points, uint32_t n, double *frame)
{
    struct leg leg = {.a = NULL};
    int lost = 0;
    for (uint32_t i = 0; i < n; i++) {
        struct scanhead_point *p = &points[i];
        const int is_on_leg = leg.a != NULL && p->t_ns >= leg.a->t_ns && p->t_ns < leg.b->t_ns;
        if (!is_on_leg && !find_leg(sh->poses, p->t_ns, &leg)) {
            leg.a = NULL;
            p->x = p->y = p->z = NAN;
            if (frame != NULL) frame[i] = NAN;
            lost++;
            continue;
        }
        double f = fraction(&leg, p->t_ns);
        place_moving(&leg, f, p);
        if (frame != NULL) frame[i] = leg.a->frame + f * (leg.b->frame - leg.a->frame);
    }
    return lost;
}

int scanhead_to_scene(struct scanhead *sh, struct scanhead_point *points, uint32_t n, double *frame)
{
    if (!sh->have_descriptor || !sh->have_anchor || sh->descriptor.layout != NATIVE_POLAR)
        return sh_fail(&sh->err, SCANHEAD_ESTATE,
                       "%s: only points of the polar layout can be converted to the scene frame", sh->source.name);
    if (sh->anchor.moving & NATIVE_MOVING) return to_scene_moving(sh, points, n, frame);
    for (uint32_t i = 0; i < n; i++) {
        const double v[3] = {points[i].x, points[i].y, points[i].z};
        place(sh->anchor.rotation, sh->anchor.station_m, v, &points[i]);
        if (frame != NULL) frame[i] = sh->anchor.frame;
    }
    return 0;
}
