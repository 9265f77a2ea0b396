/* SPDX-License-Identifier: MIT */
/* Reads windows of waveforms. Stream frames of waveforms follow the frame that has the points of their pulses. */
#include <math.h>

#include "drivers/host/host.h"
#include "drivers/protocol/native_waves.h"

#define TWO_PI 6.283185307179586476925

int scanhead_has_waves(const struct scanhead *sh)
{
    return host_has_content(sh, NATIVE_HAS_WAVES);
}

/* Several frames of waveforms may follow the points, and some may be lost. So the frame's number can't show whether the
 * frame follows these points. */
static int is_of_last_points(const struct scanhead *sh, const struct scanhead_frame *frame)
{
    return sh->have_points && frame->t_ns == sh->points_t_ns && frame->pulse0 == sh->of_points.pulse0 &&
           frame->scan_line == sh->of_points.line;
}

static double float_of(uint32_t bits)
{
    uint8_t wire[4];
    le_put32(wire, bits);
    return (double)le_get_float(wire);
}

static void set_direction(const struct scanhead *sh, const struct native_wave *w, double direction[3])
{
    const struct native_descriptor *d = &sh->descriptor;
    if (d->layout == NATIVE_GEO) {
        const uint32_t bits[3] = {w->a, w->b, w->c};
        for (int i = 0; i < 3; i++)
            direction[i] = float_of(bits[i]);
        return;
    }
    const double mirror_rad = TWO_PI * (w->b / d->mirror_counts_per_turn);
    const double pan_rad = TWO_PI * (w->c / d->pan_counts_per_turn);
    direction[0] = sin(pan_rad) * cos(mirror_rad);
    direction[1] = cos(pan_rad) * cos(mirror_rad);
    direction[2] = sin(mirror_rad);
}

static void set_wave(const struct scanhead *sh, const struct native_waves *head, const struct native_wave *w,
                     struct scanhead_wave *out)
{
    const double step_m = 1e-3 * head->sample_ps * NATIVE_M_PER_NS;
    *out = (struct scanhead_wave){.pulse = head->pulse0 + w->pulse,
                                  .t_ns = native_after_ns(sh->points_t0_ns, w->dt_ns),
                                  .first = w->first,
                                  .n = w->n,
                                  .sample = w->sample,
                                  .range_m = w->first * step_m,
                                  .step_m = step_m,
                                  .sample_ps = head->sample_ps,
                                  .bits = head->bits,
                                  .baseline = head->baseline_16 / 16.0,
                                  .count_signal = (double)head->count_signal};
    set_direction(sh, w, out->direction);
}

int scanhead_waves(struct scanhead *sh, const struct scanhead_frame *frame, uint32_t first, struct scanhead_wave *waves,
                   uint32_t max)
{
    struct native_waves head;
    struct native_wave w;
    int rc = host_check_last(sh, frame, SCANHEAD_WAVES);
    if (rc != 0) return rc;
    if (!sh->have_descriptor || !is_of_last_points(sh, frame))
        return sh_fail(&sh->err, SCANHEAD_ESTATE, "%s: the points of these waveforms were lost", sh->source.name);
    if (native_decode_waves(frame->payload, frame->payload_len, &head) != 0) return SCANHEAD_EFORMAT;
    uint32_t n = 0;
    size_t at = NATIVE_WAVES_HEAD_LEN;
    for (uint32_t i = 0; i < head.n_windows && n < max; i++) {
        at = native_decode_wave(frame->payload, at, &w);
        if (i >= first) set_wave(sh, &head, &w, &waves[n++]);
    }
    return (int)n;
}

double scanhead_wave_signal(const struct scanhead_wave *wave, uint32_t i)
{
    return (le_get16(wave->sample + NATIVE_SAMPLE_LEN * (size_t)i) - wave->baseline) * wave->count_signal;
}

int64_t scanhead_waves_lost(struct scanhead *sh, const struct scanhead_frame *frame)
{
    struct native_waves head;
    const int rc = host_check_last(sh, frame, SCANHEAD_WAVES);
    if (rc != 0) return rc;
    if (native_decode_waves(frame->payload, frame->payload_len, &head) != 0) return SCANHEAD_EFORMAT;
    return head.n_lost;
}
