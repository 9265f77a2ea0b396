/* SPDX-License-Identifier: MIT */
/* Injected faults of the head's time of day. */
#ifndef FIRMWARE_SIM_DEVICE_CLOCK_FAULTS_H
#define FIRMWARE_SIM_DEVICE_CLOCK_FAULTS_H

#include <stdint.h>

#include "firmware_sim/device/head_faults.h"

struct device_events;
struct head_clock;

/* Begins and ends those of a tick. */
void device_run_clock_faults(struct head_faults *faults, struct head_clock *clock, struct device_events *events,
                             uint64_t tick);
/* Whether pulses are lost at a device time. */
int device_has_no_pps(const struct head_faults *faults, int64_t t_ns);
/* Whether a fault suppresses the PPS event of a full second. */
int device_loses_pps(struct head_faults *faults, int64_t edge_ns);

#endif
