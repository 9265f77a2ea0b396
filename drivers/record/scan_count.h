/* SPDX-License-Identifier: MIT */
/* For repairs: counts the scans that frames or points belong to. Pure. */
#ifndef DRIVERS_RECORD_SCAN_COUNT_H
#define DRIVERS_RECORD_SCAN_COUNT_H

#include "drivers/protocol/native.h"

struct scan_count { /* begins as zeros */
    uint64_t n_scans;
    uint32_t number; /* of the last descriptor's scan; 0: none yet */
    int64_t t_ns;    /* of the last descriptor */
    int has_points;  /* points came since a scan was counted, of a scan that began at begin_ns */
    int64_t begin_ns;
};

/* Takes each whole frame of a .shs or .pcapng, in order. A scan begins with a descriptor of another scan, or with
 * points before any descriptor, or with a SCAN_START of the same number and another start. A descriptor of the same
 * scan says that settings have changed within it. */
void scan_count_frame(struct scan_count *count, const uint8_t *frame);

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
