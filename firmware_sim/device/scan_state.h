/* SPDX-License-Identifier: MIT */
/* The scan at hand, or the last one. */
#ifndef FIRMWARE_SIM_DEVICE_SCAN_STATE_H
#define FIRMWARE_SIM_DEVICE_SCAN_STATE_H

#include <stddef.h>
#include <stdint.h>

#include "core/schedule.h"
#include "firmware_sim/command/head.h"

struct device_version;
struct site;

struct device_scan {
    int on;
    const struct site *site;        /* that the scan is made with */
    struct device_version *variant; /* NULL: site is the device's */
    uint32_t number;                /* from 1 */
    uint64_t tick0;                 /* its first */
    uint64_t end_tick;              /* the first tick after it, when no scan is on */
    uint64_t pulse_next;            /* next pulse to be claimed */
    uint64_t cast;                  /* how many of the pulses before are cast */
    struct schedule_segment segment;
    /* The settings that its pulses fire with. Commands change them only in what may change within a scan. Ranges, noise
     * and station are those of `site` and `station` instead. */
    struct head_settings settings;
    int64_t prr_uhz, lines_uhz; /* as set; with a slow mirror the segment has other rates */
    uint32_t station;           /* from 0 */
    uint32_t station_scan;      /* which of its scans */
    size_t stretch;             /* of a trajectory: the one of the last pulse that is claimed */
    int describe;               /* descriptor and anchor are due, as new ones */
    int anchor_lost;            /* they are due as a repetition: a tick with a new anchor was lost */
    int stop_requested;
};

#endif
