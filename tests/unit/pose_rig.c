/* SPDX-License-Identifier: MIT */
#include "tests/unit/pose_rig.h"

const double DEG = M_PI / 180.0;

int find_path(const struct trajectory *tr, double start_s, double end_s, const struct pose *mount,
              struct pose_path *out, struct sh_err *err)
{
    const struct pose_knot_rules rules = {start_s, end_s, 1e-4, 10000000, 0.01};
    return trajectory_knots(tr, mount, &rules, NULL, out, err);
}
