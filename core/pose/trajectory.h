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

/* The straight way between two samples. */
static inline double trajectory_chord_m(const struct pose_sample *a, const struct pose_sample *b)
{
    return vec3_distance(a->pose.position_m, b->pose.position_m);
}

#endif
