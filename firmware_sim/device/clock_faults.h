/* SPDX-License-Identifier: MIT */
/* Injected faults of the head's time of day. */
#ifndef FIRMWARE_SIM_DEVICE_CLOCK_FAULTS_H
#define FIRMWARE_SIM_DEVICE_CLOCK_FAULTS_H

#include <stdint.h>

#include "firmware_sim/device/head_faults.h"

struct device_events;
struct head_clock;

/* Begins and ends the faults that do so in a tick. */
void device_run_clock_faults(struct head_faults *faults, struct head_clock *clock, struct device_events *events,
                             uint64_t tick);
/* These two functions are for kinds that strike at PPS pulses and at the receiver's sentences. Both are called after
 * head_faults_step for the tick. device_has_clock_fault says whether a fault of the kind holds at a device time.
 * device_count_clock_fault counts a pulse or a sentence, for the note of the fault's end. */
int device_has_clock_fault(const struct head_faults *faults, enum fault_kind kind, int64_t t_ns);
void device_count_clock_fault(struct head_faults *faults, enum fault_kind kind, int64_t t_ns);

/* Return how late all faults together make a sentence (at most 10 s), or a PPS pulse. In its window, a fault makes the
 * first pulse late, then the third, and so on. */
int64_t device_sentence_late_ns(const struct head_faults *faults, int64_t t_ns);
int64_t device_pulse_late_ns(const struct head_faults *faults, int64_t edge_ns);

#endif
