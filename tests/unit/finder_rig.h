/* SPDX-License-Identifier: MIT */
/* For tests of what detectors know of a pulse, and of how they find maxima. */
#ifndef TESTS_UNIT_FINDER_RIG_H
#define TESTS_UNIT_FINDER_RIG_H

#include "core/waveform/detect_inside.h"
#include "tests/unit/waveform_rig.h"

/* Returns the pulse as the detectors of a waveform know it. */
const struct finder *finder_rig_of(const struct waveform *waveform);

/* Returns a Gaussian pulse of 4 samples, limited at 10 thresholds, with noise in thresholds. */
struct waveform *finder_rig_open(double noise);

#endif
