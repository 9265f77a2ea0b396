/* SPDX-License-Identifier: MIT */
/* Tests and benches of waveforms begin with this digitiser and pulse, and change what they are about. */
#ifndef TESTS_COMMON_WAVE_SPEC_H
#define TESTS_COMMON_WAVE_SPEC_H

#include "core/waveform.h"

/* Returns a Gaussian pulse of 4 ns, sampled each ns with 12 bits, noise 1/8 of the threshold, full scale 100
 * thresholds. */
static inline struct waveform_spec wave_spec(void)
{
    return (struct waveform_spec){.shape = WAVEFORM_GAUSSIAN,
                                  .width_s = 4e-9,
                                  .skew = 1.0,
                                  .sample_s = 1e-9,
                                  .bits = 12,
                                  .baseline_counts = 200.0,
                                  .full_scale = 100.0,
                                  .noise = 0.125,
                                  .keep = 0.5,
                                  .before_s = 12e-9,
                                  .after_s = 12e-9,
                                  .seed = 7};
}

#endif
