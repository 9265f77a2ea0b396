/* SPDX-License-Identifier: MIT */
/* The head's losses, and the events for them: pulses that it could not compute in time, and lines that its files
 * lack. */
#ifndef FIRMWARE_SIM_DEVICE_OVERRUN_H
#define FIRMWARE_SIM_DEVICE_OVERRUN_H

#include <stdint.h>

#include "firmware_sim/device/device.h"
#include "firmware_sim/device/events.h"

struct command_queue;

/* Ticks and pulses that the head could not compute in time, lines that its files lack, and what events have reported of
 * both. */
struct device_overrun {
    struct device_counters *counters; /* these four are the device's */
    struct device_events *events;
    struct command_queue *queue;
    uint64_t tick_hz;
    uint64_t ticks_said, pulses_said;
    uint64_t first; /* first lost pulse that no event has named; UINT64_MAX: none */
    uint64_t tick;  /* of the last event */
    /* Lines that files of the head lack (device_files_fill): */
    uint64_t lines_said;
    uint64_t lines_tick; /* of the last event; 0: there was none */
};

/* Adds an event for the losses since the last one. The event names the first lost pulse, or pulse_next, the scan's next
 * one, where none is known. */
void device_say_overrun(struct device_overrun *overrun, uint64_t pulse_next, uint64_t tick);
/* Adds an event for lines that files lack, once a second at most. */
void device_say_lost_lines(struct device_overrun *overrun, uint64_t tick);
/* Counts a lost tick, and keeps its events for later ticks, as far as there is room. An overrun event is taken back:
 * the next one has its losses, too. Other events of ticks before off_tick, at which the head last lost power, are
 * dropped. */
void device_count_lost(struct device_overrun *overrun, const struct device_work *work, uint64_t off_tick);

#endif
