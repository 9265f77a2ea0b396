/* SPDX-License-Identifier: MIT */
/* Private to core/cast: first hits that are found before their pulses are cast, for several lines at once.
 *
 * ahead_begin takes the lines. caster.c opens window after window (ahead_open_window), from `column` to `end`. It aims
 * the window's pulses of each line (ahead_aimed), and ahead_cast finds their hits. Later ahead_take gives them to the
 * chunks that are cast. */
#ifndef CORE_CAST_AHEAD_H
#define CORE_CAST_AHEAD_H

#include "core/cast/chunk.h"
#include "core/cast/chunk_arrays.h"

enum {
    AHEAD_WINDOW = CHUNK / CAST_AHEAD_RUNS, /* consecutive pulses of each line that are cast together */
    AHEAD_STEP = 4,                         /* pulses that are copied together */
    AHEAD_ROOM = AHEAD_WINDOW + AHEAD_STEP, /* a copy may go beyond the last pulse */
    AHEAD_STEPS = CHUNK / AHEAD_STEP,       /* AHEAD_WINDOW is a multiple of AHEAD_STEP */
};

struct cast_ahead {
    struct ahead_run {
        uint64_t pulse0, column;   /* of its first pulse: the number in the scan, and the place in its line */
        uint32_t n, at;            /* pulses, and where their hits begin in the arrays below */
        uint32_t first, in_window; /* pulses in the window: the first one of the run, and how many; 0: none */
    } run[CAST_AHEAD_RUNS];
    uint32_t n_runs, room; /* pulses that the arrays have room for */
    uint32_t tile;         /* consecutive pulses of a line that go into a packet */
    uint64_t column, end;  /* places in the lines: where the next window begins, and where the last line ends */
    /* the hits, run by run; after each run there is room for AHEAD_STEP elements */
    double *range_m;
    uint32_t *triangle, *label;
    float *steep; /* only of beams with a footprint */
    /* a window, line by line: directions of its pulses */
    struct {
        double x[AHEAD_ROOM], y[AHEAD_ROOM], z[AHEAD_ROOM];
    } line[CAST_AHEAD_RUNS];
    /* the same in the order of tiles, in which they are cast, and the hits */
    struct chunk_vectors d;
    double tile_range_m[CHUNK_ROOM];
    uint32_t tile_triangle[CHUNK_ROOM], tile_label[CHUNK_ROOM];
    float tile_steep[CHUNK_ROOM];
    struct ahead_step {
        uint32_t run, pulse, at; /* pulses from `pulse` on of a line's window lie at `at` in that order */
    } step[AHEAD_STEPS];
    uint32_t n_steps;
};

/* Makes room for the hits of so many pulses. The caller frees *out, also after an error. */
int ahead_create(uint32_t pulses, struct cast_ahead **out, struct sh_err *err);
void ahead_free(struct cast_ahead *ahead);
/* Takes the runs that there is room for. */
void ahead_begin(struct cast_ahead *ahead, const struct schedule_run *run, uint32_t n_runs);
/* Opens the next window: sets `first` and `in_window` of the runs. Returns how many pulses the window has. */
uint32_t ahead_open_window(struct cast_ahead *ahead);
/* Takes the directions of run q's pulses in the window. */
void ahead_aimed(struct cast_ahead *ahead, uint32_t q, const struct vec3_in *d);
/* Finds the hits of the window's pulses. */
void ahead_cast(struct cast_ahead *ahead, const struct cast_setup *s, struct bvh_work *work, uint32_t pulses);
/* Copies the hits of the chunk's pulses to `rays` if they are known. Returns whether they are. ahead may be NULL. */
int ahead_take(const struct cast_ahead *ahead, const struct chunk *k, struct bvh_work *work,
               const struct bvh_rays *rays);

#endif
