/* SPDX-License-Identifier: MIT */
/* Tests of recorders of waveforms use these: frames of type 12, byte by byte as drivers/protocol/WAVEFORMS.md has
 * them, and the samples that are in them. */
#ifndef TESTS_UNIT_WAVES_RIG_H
#define TESTS_UNIT_WAVES_RIG_H

#include "tests/unit/recorder_rig.h"

#define RIG_C_M_S 299792458.0

struct rig_digitiser {
    uint32_t sample_ps;
    uint16_t baseline_16; /* in 1/16 counts */
    uint8_t bits;
    float count_signal;
    uint32_t n_lost;
};
extern const struct rig_digitiser rig_12_bits; /* 1 ns, 205 counts without light, 1/16 of the threshold a count */

/* A window of pulse0 + pulse, with samples of rig_sample. */
struct rig_window {
    uint32_t pulse, first;
    uint16_t n;
    uint32_t beam[3]; /* as on the wire: a, b, c */
};

/* Returns sample k of the pulse's grid: the same for all digitisers but for their bits. */
uint16_t rig_sample(const struct rig_digitiser *d, uint64_t pulse, uint32_t k);

/* Does as rig_descriptor, for a head that sends `content`: 4 are waveforms. */
void rig_wave_descriptor(int geo, uint32_t scan, uint32_t content);

/* Sends a frame of windows. pulse0 and line are those of the points frame before; a pulse is a millisecond. */
void rig_waves(uint32_t line, uint64_t pulse0, const struct rig_digitiser *d, const struct rig_window *window,
               uint32_t n);

/* Returns the bit pattern of a float. */
uint32_t rig_float_bits(float f);
float rig_float(const uint8_t *p);

#endif
