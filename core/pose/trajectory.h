/* Private to core/pose. */
#ifndef CORE_POSE_TRAJECTORY_H
#define CORE_POSE_TRAJECTORY_H

#include "core/pose.h"

struct trajectory {
    size_t n;
    struct pose_sample *sample; /* quaternions of length one */
    double (*velocity_m_s)[3];  /* at the samples */
};

#endif
