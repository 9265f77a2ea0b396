/* SPDX-License-Identifier: MIT */
/* For repairs: counts the scans that frames or points belong to. Pure. */
#ifndef DRIVERS_RECORD_SCAN_COUNT_H
#define DRIVERS_RECORD_SCAN_COUNT_H

#include "drivers/protocol/native.h"

struct scan_count { /* begins as zeros */
    uint64_t n_scans;
    int within; /* points of a scan have come, or its descriptor */
};

/* Takes each frame of a .shs or .pcapng, in order. A scan begins with a descriptor that is no repetition, or with
 * points before any descriptor. */
static inline void scan_count_frame(struct scan_count *count, uint8_t type, uint8_t flags)
{
    const int begins = type == NATIVE_DESCRIPTOR && (flags & NATIVE_REPEAT) == 0;
    if (!begins && (type != NATIVE_POINTS || count->within)) return;
    count->n_scans++;
    count->within = 1;
}

struct point_scans { /* begins as zeros */
    uint64_t n;
    long station; /* of the last point */
    double time_s;
};

/* Takes each point of a .las or .ply, in order. A new scan has another station, or its times begin anew. */
static inline void point_scans_take(struct point_scans *scans, long station, double time_s)
{
    scans->n += (uint64_t)(scans->n == 0 || station != scans->station || time_s < scans->time_s);
    scans->station = station;
    scans->time_s = time_s;
}

#endif
