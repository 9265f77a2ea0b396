/* SPDX-License-Identifier: MIT */
/* Private to core/cast: first hits that are found before their pulses are cast, for several lines at once. */
#ifndef CORE_CAST_AHEAD_H
#define CORE_CAST_AHEAD_H

#include "core/cast/chunk.h"
#include "core/cast/chunk_arrays.h"

struct caster;

enum {
    AHEAD_WINDOW = CHUNK / CAST_AHEAD_RUNS, /* consecutive pulses of each line that are cast together */
    AHEAD_STEP = 4,                         /* pulses that are copied together */
    AHEAD_ROOM = AHEAD_WINDOW + AHEAD_STEP, /* a copy may go beyond the last pulse */
    AHEAD_STEPS = CHUNK / AHEAD_STEP,       /* AHEAD_WINDOW is a multiple of AHEAD_STEP */
};

struct cast_ahead {
    struct ahead_run {
        uint64_t pulse0; /* in the scan */
        uint32_t n, at;  /* pulses, and where their hits begin in the arrays below */
    } run[CAST_AHEAD_RUNS];
    uint32_t n_runs, room; /* pulses that the arrays have room for */
    uint32_t tile;         /* consecutive pulses of a line that go into a packet */
    double *range_m;
    uint32_t *triangle, *label;
    float *steep;
    struct cast_setup setup; /* of the last call, without what only later stages need */
    /* a window, line by line: directions of its pulses, and their hits */
    struct {
        double x[AHEAD_ROOM], y[AHEAD_ROOM], z[AHEAD_ROOM], range_m[AHEAD_ROOM];
        uint32_t triangle[AHEAD_ROOM], label[AHEAD_ROOM];
        float steep[AHEAD_ROOM];
    } line[CAST_AHEAD_RUNS];
    /* the same in the order of tiles, in which they are cast */
    struct chunk_vectors d;
    double tile_range_m[CHUNK_ROOM];
    uint32_t tile_triangle[CHUNK_ROOM], tile_label[CHUNK_ROOM];
    float tile_steep[CHUNK_ROOM];
    struct ahead_step {
        uint32_t run, pulse, at; /* pulses from `pulse` on of a line's window lie at `at` in that order */
    } step[AHEAD_STEPS];
    uint32_t n_steps;
};

/* Copies the hits of the chunk's pulses to `rays` if they are known. Returns whether they are. */
int ahead_take(const struct caster *c, const struct chunk *k, const struct bvh_rays *rays);
void ahead_free(struct cast_ahead *ahead);

#endif
