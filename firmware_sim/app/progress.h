/* SPDX-License-Identifier: MIT */
/* How far long work has come, and how long it will take. In: what a stream or a report says. Out: a fraction, and
 * seconds left. Pure; the caller brings the time. */
#ifndef FIRMWARE_SIM_APP_PROGRESS_H
#define FIRMWARE_SIM_APP_PROGRESS_H

#include <stdint.h>

#include "drivers/host/scanhead.h"

/* The pace of the work at hand; pieces of work follow each other. The caller sets all to 0 before the first one. */
struct progress_pace {
    char what[64];
    int64_t since_ns;
    double fraction; /* then */
};

/* Seconds left, by the pace since the first report of the same work: `what` up to a colon names it. Where the fraction
 * falls, the pace is measured anew from there. Negative where it is not known: the first report, an unknown fraction,
 * or nothing done since. */
double progress_left_s(struct progress_pace *pace, const char *what, double fraction, int64_t now_ns);

/* Returns how long a scan lasts by its descriptor, from the first pulse on; 0: it has no end, or the frame is no
 * descriptor. */
double progress_scan_s(const struct scanhead_frame *descriptor);

#endif
