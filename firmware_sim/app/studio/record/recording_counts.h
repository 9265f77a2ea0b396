/* SPDX-License-Identifier: MIT */
/* The pulses of a recording: what came, and what the head says of the rest. COUNTS.md defines the words.
 *
 * In: each frame of the stream. Out: sums over the scans whose end is known: by SCAN_END or, where that was lost, by
 * telemetry of the idle head, by a frame of another scan, or by recording_count_end. A head that started again gives
 * its scans the numbers of earlier ones: LOSSES.md says how such scans are told apart.
 *
 * The final counts of a scan come with a telemetry of any state but scanning. The last one before SCAN_END has them. If
 * that one was lost, the scan counts with what is known at least, and the next telemetry corrects the sums. */
#ifndef FIRMWARE_SIM_APP_STUDIO_RECORD_RECORDING_COUNTS_H
#define FIRMWARE_SIM_APP_STUDIO_RECORD_RECORDING_COUNTS_H

#include <stdint.h>

#include "drivers/host/scanhead.h"

struct recording_counts {
    uint64_t scans;       /* that ended */
    uint64_t pulses;      /* received, in scans that have not ended, too */
    uint64_t fired, cast; /* of scans that ended */
    uint64_t lost;        /* by the head */
    uint64_t left_out;    /* in frames that the head left out for this reader, as it says */
    uint64_t missing;     /* delivered by the head in scans that ended, and not received, whatever the reason */
    uint64_t unknown; /* scans that ended, and whose final counts did not come: fired, cast and missing may be more */
    /* Inner state: the scan at hand. What is above are counts alone (recording_add). */
    int within; /* points of it came, and its end did not */
    struct {
        uint32_t number;                 /* 0: not known */
        int is_seen_begin;               /* its SCAN_START came */
        int64_t t0_ns, last_ns;          /* device time of its pulse 0, and of its last points frame */
        uint64_t pulses, left_out, lost; /* since it began, or the recording did; lost: as OVERRUN says */
    } scan;
    struct {
        uint32_t scan; /* 0: none came */
        int is_final;
        uint64_t fired, cast, lost;
    } told; /* by the last telemetry */
    struct {
        uint32_t scan; /* 0: none */
        uint64_t pulses, fired, cast, lost;
    } due;          /* the scan that ended last, as it was counted, while its final counts may still come */
    uint32_t ended; /* number of the last scan that ended, until the next one begins */
};

enum recording_news {
    RECORDING_NOTHING,
    RECORDING_SCAN_OVER, /* its SCAN_END came */
    RECORDING_END_LOST,  /* the scan is over, and its SCAN_END did not come */
};

/* Takes a frame. frames_lost: some were lost in this recording; asked for telemetry and events alone. */
enum recording_news recording_count(struct recording_counts *counts, const struct scanhead_frame *frame,
                                    int frames_lost);
/* Ends the scan at hand without a frame that says so, as when the head answers that it is idle. */
void recording_count_end(struct recording_counts *counts);

#endif
