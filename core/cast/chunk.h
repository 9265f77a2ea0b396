/* SPDX-License-Identifier: MIT */
/* Private to core/cast: a chunk says which pulses are at hand, and where they go. The stages of a pulse pass it on. */
#ifndef CORE_CAST_CHUNK_H
#define CORE_CAST_CHUNK_H

#include "core/cast.h"

/* A chunk: consecutive pulses of a run, and where they go in the block. */
struct chunk {
    const struct cast_setup *s;
    const struct schedule_run *run;
    struct line_block *block;
    const uint32_t *dt_ns; /* of its pulses */
    uint64_t pulse0;       /* number of its first pulse in the scan */
    uint32_t first, n;     /* pulses first .. first + n - 1 of the run */
    uint32_t at;           /* the block's entry that comes next */
    struct bvh_origins from;
    int linear;     /* the directions that the encoders read are turned into the CRS already */
    int attributes; /* the block has room for them */
    int colours;    /* the setup asks for them, and the block has room */
    int texels;     /* colours are those of textures: hits carry them */
    int waves;      /* waveforms are sent, or searched for echoes */
    int spreads;    /* returns say how their ranges spread: for widths, or for waveforms */
};

#endif
