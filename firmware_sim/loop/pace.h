/* SPDX-License-Identifier: MIT */
/* Decides what the pacing thread does next, in real time. Pure: the caller reads the clock.
 *
 * In: the tick whose turn it is, whether it is ready, and the time. Out: sleep, wait for the tick, release it, or give
 * it up; and how late wake-ups and releases were.
 *
 * A tick is due when its last pulse has fired. Ticks that go out together are due with the last of them. A late tick is
 * released as soon as it is ready. If the pacing thread slept until the next tick is due instead, a head with few ticks
 * ahead would never catch up.
 *
 * A tick that is not ready late_ns after its time is given up. A machine that stood still gets credit, since the
 * casters stood still, too: the longest such time is added to late_ns until the pacing thread has caught up.
 *
 * Units: ns of clock_now_ns(). Thread: the pacing thread alone; lateness may be read by others. Real-time safe. */
#ifndef FIRMWARE_SIM_LOOP_PACE_H
#define FIRMWARE_SIM_LOOP_PACE_H

#include "firmware_sim/device/device.h"
#include "firmware_sim/loop/lateness.h"

struct pace {
    /* set by the caller */
    int64_t epoch_ns, tick_ns; /* tick i is due at epoch_ns + (i + 1) tick_ns */
    int64_t late_ns;           /* loop.late_ms */
    struct device_counters *counters;
    uint64_t together_until; /* ticks up to this one go out together; set it before pace_look gets a later one */

    int64_t credit_ns;
    int64_t expected_ns;  /* when pace_look should be called next; a later call shows a standstill */
    int asleep;           /* it was told to sleep up to then */
    struct lateness wake; /* of the wake-ups from such a sleep */
    struct lateness late; /* of releases */
};

enum pace_step { PACE_SLEEP, PACE_AWAIT, PACE_RELEASE, PACE_GIVE_UP };

/* Before the first tick. */
void pace_begin(struct pace *pace, int64_t now_ns);
/* SLEEP: up to until_ns. AWAIT: until the tick is ready, up to until_ns at most. */
enum pace_step pace_look(struct pace *pace, uint64_t tick, int ready, int64_t now_ns, int64_t *until_ns);
/* Called after the tick was published and its readers were woken. Notes how late the tick is, and counts it in
 * late_blocks if it is late by more than a tick. */
void pace_released(struct pace *pace, uint64_t tick, int64_t now_ns);

#endif
