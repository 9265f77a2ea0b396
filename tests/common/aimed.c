/* SPDX-License-Identifier: MIT */
#include "tests/common/aimed.h"

#include <stdlib.h>

#include "core/cast/kernels_aim.h"

void aimed_angles(const struct schedule_run *run, uint32_t first, uint32_t n, double *mirror_turn, double *pan_turn)
{
    (run->firing != NULL ? kernel_angles_table : kernel_angles)(run, first, n, mirror_turn, pan_turn);
}

void aimed_directions(const struct schedule_run *run, const double rotation[9], const struct vec3_out *d)
{
    double *mirror = malloc(2 * run->n * sizeof *mirror), *pan = mirror + run->n;
    aimed_angles(run, 0, run->n, mirror, pan);
    kernel_directions(&(struct kernel_turns){run->n, mirror, pan}, rotation, d, NULL);
    free(mirror);
}
