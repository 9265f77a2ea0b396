/* SPDX-License-Identifier: MIT */
/* The state of the pulses per second that the head's clock follows.
 *
 * In: each full second that has a pulse, in order of time. Out: at a device time, whether pulses come (absent: none for
 * more than a second), whether they agree with the clock, and whether the time of day was ever set. A pulse agrees when
 * the time since the one before is the seconds that the clock counted, to PPS_TOLERANCE_NS a second. One that does not is
 * an error. Pulses without a gap lock the clock after PPS_TO_LOCK of them.
 * The last PPS_KEPT changes are kept, since sessions ask for past times. Pure; the owner has the lock. */
#ifndef FIRMWARE_SIM_DEVICE_PPS_H
#define FIRMWARE_SIM_DEVICE_PPS_H

#include <stdint.h>

#include "drivers/protocol/protocol.h"

enum { PPS_KEPT = 64, PPS_TO_LOCK = 2, PPS_TOLERANCE_NS = 1000000 /* 1000 ppm: more than any oscillator is off */ };

struct pps_state {
    int64_t from_ns; /* device time */
    int64_t tai_s;   /* of the pulse that came then; INT64_MIN: power came, and none has come yet */
    enum protocol_pps state;
    int run; /* pulses that agreed, without a gap */
    int set; /* the time of day was set */
};

struct pps {
    uint32_t n; /* so far; the last PPS_KEPT are kept */
    struct pps_state kept[PPS_KEPT];
};

/* Power comes. lost: no pulses come then, so that the time of day is not set before one does. Else a battery has kept
 * it. */
void pps_power_up(struct pps *pps, int64_t t_ns, int lost);
void pps_take(struct pps *pps, int64_t edge_ns, int64_t tai_s);
enum protocol_pps pps_at(const struct pps *pps, int64_t t_ns, int *set);

#endif
