/* SPDX-License-Identifier: MIT */
#include "tests/unit/waves_rig.h"

const struct rig_digitiser rig_12_bits = {1000, 205 * 16, 12, 0.0625f, 0};

uint16_t rig_sample(const struct rig_digitiser *d, uint64_t pulse, uint32_t k)
{
    return (uint16_t)((7919 * (pulse + 1) + 104729 * (uint64_t)k) % (1u << d->bits));
}

void rig_wave_descriptor(int geo, uint32_t scan, uint32_t content)
{
    static uint8_t out[1024];
    struct native_descriptor d = {.idn = "Maker,Model,SN1,1.0",
                                  .profile = "model",
                                  .scan = scan,
                                  .layout = geo ? NATIVE_GEO : NATIVE_POLAR,
                                  .prr_uhz = 1000000000,
                                  .mirror_counts_per_turn = 3600,
                                  .pan_counts_per_turn = 3600,
                                  .range_scale_m = 1e-3,
                                  .content = content};
    rig_put(out, native_encode_descriptor(out, sizeof out, &d, 0, 0));
}

static size_t put_window(uint8_t *at, const struct rig_digitiser *d, uint64_t pulse0, const struct rig_window *w)
{
    le_put32(at, w->pulse);
    le_put32(at + 4, w->pulse * 1000000);
    le_put32(at + 8, w->first);
    le_put16(at + 12, w->n);
    le_put16(at + 14, 0);
    for (int i = 0; i < 3; i++)
        le_put32(at + 16 + 4 * i, w->beam[i]);
    for (uint32_t i = 0; i < w->n; i++)
        le_put16(at + 28 + 2 * (size_t)i, rig_sample(d, pulse0 + w->pulse, w->first + i));
    if (w->n % 2 == 1) le_put16(at + 28 + 2 * (size_t)w->n, 0);
    return 28 + 2 * ((size_t)w->n + w->n % 2);
}

void rig_waves(uint32_t line, uint64_t pulse0, const struct rig_digitiser *d, const struct rig_window *window,
               uint32_t n)
{
    static uint8_t out[28 + 65536];
    uint8_t *payload = out + 28;
    size_t len = 32;
    memset(out, 0, 28 + 32);
    le_put64(payload, pulse0);
    le_put32(payload + 8, line);
    le_put32(payload + 12, n);
    le_put32(payload + 16, d->sample_ps);
    le_put16(payload + 20, d->baseline_16);
    payload[22] = d->bits;
    le_put_float(payload + 24, d->count_signal);
    le_put32(payload + 28, d->n_lost);
    for (uint32_t i = 0; i < n; i++) {
        assert_true(len + 28 + 2 * (size_t)window[i].n + 2 <= 65536);
        len += put_window(payload + len, d, pulse0, &window[i]);
    }
    out[0] = 0xd5;
    out[1] = 12;
    out[2] = 1;
    le_put32(out + 4, (uint32_t)len);
    le_put64(out + 16, (uint64_t)(rig_scan_t0_ns + (int64_t)pulse0 * 1000000));
    native_reseal(out, 28 + len);
    rig_put(out, 28 + len);
}

uint32_t rig_float_bits(float f)
{
    uint32_t bits;
    memcpy(&bits, &f, sizeof bits);
    return bits;
}

float rig_float(const uint8_t *p)
{
    const uint32_t bits = (uint32_t)rig_uint(p, 4);
    float f;
    memcpy(&f, &bits, sizeof f);
    return f;
}
