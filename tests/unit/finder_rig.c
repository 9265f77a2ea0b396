/* SPDX-License-Identifier: MIT */
#include "tests/unit/finder_rig.h"

#include "core/waveform/waveform_inside.h"

const struct finder *finder_rig_of(const struct waveform *waveform)
{
    return &waveform->finder;
}
