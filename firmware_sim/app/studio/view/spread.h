/* SPDX-License-Identifier: MIT */
/* Points spread evenly over a recording's meshes, as `scanhead record --sparse` makes them. In: density, long-edge
 * factor, seed. Out: points with range, reflectance, label, station, and colour where the recording has it. */
#ifndef FIRMWARE_SIM_APP_STUDIO_VIEW_SPREAD_H
#define FIRMWARE_SIM_APP_STUDIO_VIEW_SPREAD_H

#include "firmware_sim/app/studio/view/viewed.h"

struct view_spread {
    double per_m2, long_edge; /* long_edge 0: no filter */
    uint64_t seed, scan;      /* scan: the mesh, from 1; 0: all of them, one after the other */
};

/* SH_EINPUT where there would be more than VIEW_MAX_SPARSE points, with the density that is possible. SH_ENOMEM,
 * SH_ESTOPPED. cloud_free is due in any case. */
int view_spread(const struct viewed *viewed, const struct view_spread *wish, const struct sh_report *report,
                struct cloud *out, struct sh_err *err);

#endif
