/* SPDX-License-Identifier: MIT */
/* Private to las*.c: the recorder of .las. */
#ifndef DRIVERS_RECORD_LAS_INSIDE_H
#define DRIVERS_RECORD_LAS_INSIDE_H

#include "drivers/protocol/native.h"
#include "drivers/record/las_columns.h"
#include "drivers/record/recorder.h"

struct las {
    struct recorder base;
    struct las_facts facts;
    int begun, time_came_late;
    uint64_t n_no_angle;
    uint64_t n_beyond_returns, n_returns_cut; /* LAS 1.2 */
    uint64_t n_waves_left_out;                /* LAS 1.2, or the head sent none as the file began */
    struct las_waves waves;
    struct las_columns columns;   /* of the batch */
    double place[3][TRACK_BATCH]; /* the batch's coordinates, from which counts or angles are made */
};

/* Geodetic coordinates are longitude, latitude in LAS, as GIS software draws x and y. */
static inline int las_is_swapped(const struct las *las)
{
    return las->base.track.crs == NATIVE_CRS_GEODETIC;
}

static inline void las_swap(double v[3])
{
    double x = v[0];
    v[0] = v[1];
    v[1] = x;
}

/* Writes the bytes before the points, or writes them again, with the present facts. */
int las_write_front(struct las *las, struct sh_err *err);
/* Takes the n points of the batch (las_points.c). */
int las_points(void *rec, int n, struct sh_err *err);

#endif
