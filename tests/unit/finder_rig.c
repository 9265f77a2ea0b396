/* SPDX-License-Identifier: MIT */
#include "tests/unit/finder_rig.h"

#include "core/waveform/waveform_inside.h"

const struct finder *finder_rig_of(const struct waveform *waveform)
{
    return &waveform->finder;
}

struct waveform *finder_rig_open(double noise)
{
    struct waveform_spec spec = waveform_rig_spec();
    spec.noise = noise;
    spec.full_scale = 10.0;
    return waveform_rig_open(&spec);
}
