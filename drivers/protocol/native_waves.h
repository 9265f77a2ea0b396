/* SPDX-License-Identifier: MIT */
/* Decodes waveforms (WAVEFORMS.md): payloads of type 12 into windows of samples, and the deviations that attributes
 * have.
 *
 * native_encode.h writes them. Pure; allocates nothing; any thread. */
#ifndef DRIVERS_PROTOCOL_NATIVE_WAVES_H
#define DRIVERS_PROTOCOL_NATIVE_WAVES_H

#include "drivers/protocol/native.h"

enum {
    NATIVE_WAVES_HEAD_LEN = 32,
    NATIVE_WAVE_LEN = 28, /* of a window, without its samples */
    NATIVE_SAMPLE_LEN = 2,
    NATIVE_MAX_SAMPLES = 4096, /* of a window */
    NATIVE_MIN_BITS = 8,
    NATIVE_MAX_BITS = 14,
    NATIVE_DEVIATION_LEN = 2,
};

/* Range of one nanosecond of a pulse's way out and back, m. */
#define NATIVE_M_PER_NS (0.5 * 0.299792458)

struct native_waves { /* begin of a payload; then n_windows windows */
    uint64_t pulse0;
    uint32_t line, n_windows;
    uint32_t sample_ps;   /* time between samples */
    uint16_t baseline_16; /* the count without light, in 1/16 counts */
    uint8_t bits;         /* of a sample */
    uint8_t reserved;     /* 0 */
    float count_signal;   /* signal of one count, in units of the detection threshold */
    uint32_t n_lost;      /* samples that found no room in the head */
};

/* A window: 0 u32 pulse, 4 u32 time, 8 u32 first, 12 u16 n, 14 u16 0, 16 u32 a, 20 u32 b, 24 u32 c; then n samples of
 * u16, and one u16 of 0 where n is odd. */
struct native_wave {
    uint32_t pulse, dt_ns; /* after pulse0, and after t0_ns of the points frame */
    uint32_t first, n;     /* samples, by their number on the pulse's grid */
    uint32_t a, b, c;      /* polar: 0, mirror, pan; geo: bit patterns of floats, change of x, y, z along a metre */
    const uint8_t *sample; /* in the payload */
};

/* Bytes of a window of n samples. */
static inline size_t native_wave_len(uint32_t n)
{
    return NATIVE_WAVE_LEN + NATIVE_SAMPLE_LEN * (size_t)(n + (n & 1));
}

/* Checks all windows. Returns 0, or SH_EFORMAT. */
int native_decode_waves(const uint8_t *payload, size_t len, struct native_waves *out);

/* The window at byte `at` of a checked payload; the first one is at NATIVE_WAVES_HEAD_LEN. Returns where the next one
 * is. */
static inline size_t native_decode_wave(const uint8_t *payload, size_t at, struct native_wave *out)
{
    const uint8_t *p = payload + at;
    out->pulse = le_get32(p);
    out->dt_ns = le_get32(p + 4);
    out->first = le_get32(p + 8);
    out->n = le_get16(p + 12);
    out->a = le_get32(p + 16);
    out->b = le_get32(p + 20);
    out->c = le_get32(p + 24);
    out->sample = p + NATIVE_WAVE_LEN;
    return at + native_wave_len(out->n);
}

/* Checks that an attributes payload has the deviations of its n_points after its records. 0, or SH_EFORMAT. */
int native_check_deviations(size_t len, uint32_t n_points);
/* Returns the deviation of point i < n_points of such a payload, in 1/1000; 65535: that much or more. */
static inline uint16_t native_decode_deviation(const uint8_t *payload, uint32_t n_points, uint32_t i)
{
    return le_get16(payload + NATIVE_ATTRIBUTES_HEAD_LEN + (size_t)n_points * NATIVE_ATTRIBUTE_LEN +
                    (size_t)i * NATIVE_DEVIATION_LEN);
}

#endif
