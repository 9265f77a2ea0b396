/* SPDX-License-Identifier: MIT */
/* The GNSS receiver that stands with the head.
 *
 * In: the head's pose and the true time (head_clock.h). Out: fixes with the position of its antenna at multiples
 * of 1/rate_hz of UTC. drivers/protocol makes NMEA 0183 sentences of them.
 *
 * The receiver runs from power-up on, also while the head does not scan. (In the pace `fast`, device time itself
 * stands still while the head has nothing to do.) The antenna is at the head's origin plus gnss.lever_arm_m
 * in the head's frame. The receiver's noise, if any, is normal and independent east, north and up. The noise is keyed
 * by noise.seed and the number of the position since power-up. Thread: constant after the clock is powered
 * up. */
#ifndef FIRMWARE_SIM_DEVICE_GNSS_H
#define FIRMWARE_SIM_DEVICE_GNSS_H

#include "drivers/protocol/nmea.h"
#include "firmware_sim/device/head_clock.h"
#include "firmware_sim/site/site.h"

struct gnss {
    const struct site *site;
    const struct head_clock *clock;
    int on; /* the time is known, and the protocol of a link may ask for fixes */
    int64_t period_ns;
};

/* site and clock must outlive it. */
void gnss_init(struct gnss *gnss, const struct site *site, const struct head_clock *clock);

/* Positions before a device time, from power-up on; 0 where no link wants any. Real-time safe. */
uint64_t gnss_count(const struct gnss *gnss, int64_t t_ns);
/* Device time of a position, counted from 0. */
int64_t gnss_time_ns(const struct gnss *gnss, uint64_t index);

/* The head's pose at a time, and a little before and after, from which speed and course follow. */
#define GNSS_STEP_NS 5000000
struct gnss_track {
    struct pose before, at, after; /* GNSS_STEP_NS apart; before or after equals `at` where there is no such pose */
    int64_t span_ns;               /* from before to after; 0: there is neither, and no speed is known */
};

/* A position. track NULL: the head stands at the station (0..n_stations-1). Else the position
 * follows from track; its quality is 0 where that is no place on the Earth. */
void gnss_fix(const struct gnss *gnss, uint64_t index, uint32_t station, const struct gnss_track *track,
              struct nmea_fix *fix);

#endif
