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
/* For kinds that strike at pulses and sentences, after a step of the tick: whether one has this device time; for how
 * long all of them together; counts the pulse or sentence for the note of their end. */
int device_has_clock_fault(const struct head_faults *faults, enum fault_kind kind, int64_t t_ns);
int64_t device_clock_fault_ns(const struct head_faults *faults, enum fault_kind kind, int64_t t_ns);
void device_count_clock_fault(struct head_faults *faults, enum fault_kind kind, int64_t t_ns);

#endif
