/* SPDX-License-Identifier: MIT */
/* Tests of waveforms share these: a plain head, and pulses in closed form, written down once more. */
#ifndef TESTS_UNIT_WAVEFORM_RIG_H
#define TESTS_UNIT_WAVEFORM_RIG_H

#include "core/waveform.h"
#include "tests/common/cases.h"

/* Samples of 1 ns lie this far apart in range. */
#define SAMPLE_M 0.149896229

/* Returns a Gaussian pulse of 4 ns, 12 bits, nothing limited, no noise. */
struct waveform_spec waveform_rig_spec(void);
struct waveform *waveform_rig_open(const struct waveform_spec *spec);
/* Returns the pulse that the spec asks for, without the receiver, t after its centroid: Gaussian (skew 1), or
 * log-normal. */
double waveform_rig_pulse(const struct waveform_spec *spec, double t_s);
double waveform_rig_area_s(const struct waveform_spec *spec);
/* Returns sigma of the receiver, from the definition: half of the power at the bandwidth. */
double waveform_rig_receiver_s(const struct waveform_spec *spec);

#endif
