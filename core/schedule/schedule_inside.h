/* SPDX-License-Identifier: MIT */
/* Private to this folder: pulses and ticks, lines and places of a segment.
 *
 * A tick is seg->tick_num / seg->tick_den nanoseconds. Without a firing table each tick has a pulse; with one,
 * pulse k of the scan fires tau(k) = (k div n) * sequence_ticks + firing[k mod n].tick ticks after the scan's
 * first, whatever the segments. */
#ifndef CORE_SCHEDULE_INSIDE_H
#define CORE_SCHEDULE_INSIDE_H

#include <stddef.h>

#include "core/schedule.h"
#include "core/wide.h"

#define TURN_UDEG    360000000LL
#define NS_TIMES_UHZ 1000000000000000ull /* ns per second x micro-hertz per hertz */

static inline uint64_t ceil_div(u128 a, u128 b)
{
    return (uint64_t)((a + b - 1) / b);
}

static inline enum emitter_kind kind_of(const struct schedule_segment *seg)
{
    return seg->spec.emitter != NULL ? seg->spec.emitter->kind : EMITTER_LINE;
}

static inline uint64_t firing_tau(const struct emitter *emitter, uint64_t k)
{
    return k / emitter->n_beams * emitter->sequence_ticks + emitter->firing[k % emitter->n_beams].tick;
}

/* Returns the ticks from the segment's first pulse to pulse k. */
static inline uint64_t firing_ticks(const struct schedule_segment *seg, uint64_t k)
{
    if (kind_of(seg) != EMITTER_BEAMS) return k - seg->k0;
    return firing_tau(seg->spec.emitter, k) - firing_tau(seg->spec.emitter, seg->k0);
}

/* Returns the first pulse that fires at `ticks` after the segment's first, or later. */
static inline uint64_t firing_after(const struct schedule_segment *seg, uint64_t ticks)
{
    if (kind_of(seg) != EMITTER_BEAMS) return seg->k0 + ticks;
    const struct emitter *e = seg->spec.emitter;
    const uint64_t tau = firing_tau(e, seg->k0) + ticks, rest = tau % e->sequence_ticks;
    uint64_t i = 0;
    while (i < e->n_beams && e->firing[i].tick < rest)
        i++;
    return tau / e->sequence_ticks * e->n_beams + i;
}

/* Returns the first pulse of line n in the scan: the first one with r0 + ticks*num >= (n - line0)*den. */
static inline uint64_t line_first_pulse(const struct schedule_segment *seg, uint64_t n)
{
    if (n <= seg->line0) return seg->k0;
    u128 need = (u128)(n - seg->line0) * seg->den - seg->r0;
    return firing_after(seg, ceil_div(need, seg->num));
}

/* Returns the place of pulse k in the sweep of its line n, in 1/den of a line. */
static inline uint64_t place_in_sweep(const struct schedule_segment *seg, uint64_t k, uint64_t n)
{
    return (uint64_t)((u128)seg->r0 + (u128)firing_ticks(seg, k) * seg->num - (u128)(n - seg->line0) * seg->den);
}

static inline uint32_t frame_of_line(const struct schedule_segment *seg, uint64_t n, uint64_t *first_line)
{
    if (n < seg->frame0_end) {
        *first_line = seg->line0;
        return seg->frame0;
    }
    uint64_t f = (n - seg->frame0_end) / seg->frame_lines;
    *first_line = seg->frame0_end + f * seg->frame_lines;
    return seg->frame0 + 1 + (uint32_t)f;
}

/* angles.c: the pan at pulse k in 2^-24 micro-degrees. first_line is the first line of the pulse's pan sweep (a
 * frame). The pan is rounded up. So rounding never adds a line to a pan sweep in which a setting changes. */
int64_t pan_fine(const struct schedule_segment *seg, uint64_t k, uint64_t first_line);

#endif
