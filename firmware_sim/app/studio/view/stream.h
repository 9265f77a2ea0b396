/* SPDX-License-Identifier: MIT */
/* Private to stream.c and grid.c: a stream that is being loaded. */
#ifndef FIRMWARE_SIM_APP_STUDIO_VIEW_STREAM_H
#define FIRMWARE_SIM_APP_STUDIO_VIEW_STREAM_H

#include "drivers/record/mesh_grid.h"
#include "drivers/record/track.h"
#include "firmware_sim/app/studio/record/recording_counts.h"
#include "firmware_sim/app/studio/view/viewed.h"

struct viewed_stream {
    struct viewed *v;
    const struct sh_report *report;
    struct track track;
    struct mesh_grid grid;
    uint32_t *at; /* [grid.n] its points' numbers in the recording */
    size_t room_at, room;
    unsigned has; /* columns */
    int no_mesh;
    double file_bytes;
    struct recording_counts counts;
};

/* Makes the mesh of the present grid, as drivers/record/mesh.c does. The caller begins another grid, or is done. */
int viewed_end_grid(struct viewed_stream *stream, struct sh_err *err);

#endif
