/* SPDX-License-Identifier: MIT */
/* Private to core/pose: what a trajectory consists of. In: samples (seconds, poses in prcs, metres), which
 * trajectory_files.c reads. Out: the struct from which trajectory.c makes the curve and its knots. */
#ifndef CORE_POSE_TRAJECTORY_H
#define CORE_POSE_TRAJECTORY_H

#include "core/pose.h"
#include "core/vec3.h"

struct trajectory {
    size_t n;
    struct pose_sample *sample; /* quaternions of length one */
    double (*velocity_m_s)[3];  /* at the samples */
};

/* Whether a sample is at least POSE_MIN_STEP_US after the one before. Times of a UNIX clock are rounded to parts of a
 * microsecond, so that the step between two of them may come out shorter by one such part. */
static inline int trajectory_is_later(const struct pose_sample *s, const struct pose_sample *before)
{
    return s->t_s - before->t_s > 0.999e-6 * POSE_MIN_STEP_US - 0x1p-51 * fabs(s->t_s);
}

/* The straight way between two samples. */
static inline double trajectory_chord_m(const struct pose_sample *a, const struct pose_sample *b)
{
    return vec3_distance(a->pose.position_m, b->pose.position_m);
}

#endif
