/* SPDX-License-Identifier: MIT */
/* The frames in which the device describes itself. */
#ifndef FIRMWARE_SIM_DEVICE_FRAMES_H
#define FIRMWARE_SIM_DEVICE_FRAMES_H

#include <stdint.h>

#include "firmware_sim/device/scan_state.h"

struct native_beam;
struct native_descriptor;
struct native_emitter;

/* waves: 1 where waveforms are sent. */
void device_fill_descriptor(const struct device_scan *scan, const char *idn, uint32_t waves,
                            struct native_descriptor *d);
/* For a line head, which has no such frame, the kind is NATIVE_EMIT_LINE. echoes: those that are sent, enum
 * beam_select. beam: [NATIVE_MAX_BEAMS]. */
void device_fill_emitter(const struct device_scan *scan, uint32_t echoes, struct native_emitter *e,
                         struct native_beam *beam);

#endif
