/* SPDX-License-Identifier: MIT */
/* The schedule: when each pulse fires, and how far mirror and pan have turned then. In: the settings of a
 * scan, and a pulse number. Out: nanoseconds since the scan's start, angles in turns. Integers and exact
 * ratios; nothing accumulates. core/cast/aim.c makes directions from the turns.
 *
 * A scan is a list of segments; each change of a setting opens one. Within a segment, pulse i (from its
 * first pulse) fires at t(i) = t0_ns + floor((t0_acc + i * 1e15) / prr_uhz) ns. The pulse's place in the mirror
 * sweep is the ratio r(i)/den with r(i) = r0 + i*num - n*den. n is the number of lines passed, and num/den is
 * lines_uhz/prr_uhz reduced. The pan turns with time: pan_udeg_s * i / prr from the frame's first pulse. The
 * products are formed in 128 bits: exact for pulse numbers to 2^50 (15 years at 2.2 MHz).
 *
 * Angles are in turns (1 turn = 2 pi rad) until a sine is needed, so that reduction is exact.
 * A frame is one pan sweep, a whole number of lines. With pan speed 0, or no pan range, it is one line.
 * Pure; any thread. */
#ifndef CORE_SCHEDULE_H
#define CORE_SCHEDULE_H

#include <stdint.h>

#include "core/emitter.h"

enum { SCHEDULE_PACKET = 16 }; /* pulses of a packet; packets are counted from the line's first pulse */

struct schedule_spec {
    int64_t prr_uhz, lines_uhz, pan_udeg_s;  /* micro-hertz, lines_uhz <= prr_uhz; micro-degrees per second */
    int64_t fov_min_udeg, sweep_udeg;        /* line angle at phase 0, and how far the whole sweep goes */
    int64_t line_start_udeg, line_stop_udeg; /* cast window, both ends included; a sphere's may cross azimuth 0 */
    int64_t pan_start_udeg, pan_stop_udeg;
    uint32_t frames; /* 0: without end */
    /* NULL: a line head. With an emitter the pan stands still. Line angles then count from azimuth 0, in a planar head
     * from its front step (emitter_step_udeg). prr_uhz is then steps * lines_uhz; for beams it has no effect. */
    const struct emitter *emitter;
};

struct schedule_segment {
    struct schedule_spec spec;
    uint64_t k0;   /* first pulse, in the scan */
    int64_t t0_ns; /* its time since the scan's start: t0_ns + t0_acc / tick_den nanoseconds */
    uint64_t t0_acc;
    uint64_t line0, r0;   /* its line, and place in the sweep as r0/den */
    uint64_t line0_begin; /* first pulse of line0, before k0 where the line began in an earlier segment ... */
    int64_t line0_begin_ns;
    uint64_t line0_cast;         /* ... and how many of its pulses were cast there */
    uint64_t tick_num, tick_den; /* a tick: nanoseconds */
    uint64_t num, den;           /* lines per tick */
    int64_t ns_quot;             /* a tick = ns_quot + ns_rem / tick_den nanoseconds */
    uint64_t ns_rem;
    uint64_t r_first, r_last; /* cast where r_first <= r <= r_last */
    uint32_t front_step;      /* planar, sphere: the step that looks along y */
    uint32_t frame0;          /* frame at k0 */
    uint64_t frame0_end;      /* first line after that frame */
    uint64_t frame_lines;     /* lines of each later frame */
    int64_t pan0_fine;        /* pan at k0, in 2^-24 micro-degrees */
    uint64_t end_pulse;       /* first pulse after the last frame, in the scan; UINT64_MAX without end */
};

/* Consecutive pulses of one line that are cast, as the caster needs them. */
struct schedule_run {
    uint64_t pulse0;  /* first pulse, in the scan */
    uint32_t n;       /* pulses */
    uint32_t in_line; /* index of pulse0 from the line's first pulse in this segment */
    uint32_t frame, line;
    int64_t t0_ns, line_t0_ns;
    double mirror0_turn, mirror_turn_per_r; /* mirror = mirror0 + (r + j*num) * per_r, j from 0 */
    uint64_t r, num;
    double pan0_turn, pan_step_turn; /* pan = pan0 + (in_line + j) * step; pan0 is that of the line's first pulse */
    uint64_t ns_acc, ns_rem, ns_den; /* dt(j) = j*ns_quot + floor((ns_acc + j*ns_rem) / ns_den) */
    int64_t ns_quot;
    /* The table of beams or directions, else NULL. Pulse j uses row i = (firing_at + j) mod n_firings:
     * mirror = firing[i].mirror_turn, pan = (r + d*num) * pan_turn_per_r + firing[i].pan_turn.
     * In a head of beams, pulse j fires d(j) ticks after the run's first pulse. In such a head d(j) replaces j in dt
     * above: d(j) = (firing_at + j) div n_firings * sequence_ticks + firing[i].tick - firing[firing_at].tick.
     * A list of directions has a pulse each tick: its sequence_ticks is 0, and dt holds as it stands. */
    const struct emitter_firing *firing;
    uint32_t n_firings, firing_at;
    uint64_t sequence_ticks;
    double pan_turn_per_r;
};

/* A line's place in a segment. */
struct schedule_line {
    uint64_t line, pulse0, pulse_end; /* in the scan; clipped to the segment's start and the scan's end */
    uint64_t cast0, cast_end;         /* cast pulses: cast0 <= k < cast_end */
    uint64_t r_first_pulse;           /* r of pulse0 */
    uint64_t begin, cast_before;      /* the line's first pulse, maybe in an earlier segment; pulses cast there */
    int64_t begin_ns;                 /* time of begin */
    uint32_t frame;
    int last_of_frame;
};

/* Makes the first segment of a scan: pulse 0 at time 0, line 0, phase 0. The spec must have been checked. */
void schedule_start(struct schedule_segment *seg, const struct schedule_spec *spec);

/* Makes the segment that follows `before` from pulse k on, with a new spec. The pulse keeps its time, the mirror
 * its phase (to 1/den of a line), the pan its angle (to 2^-24 micro-degrees). The frame ends with the first line
 * whose end is at or beyond the new pan stop. No pulse is lost or doubled. seg may be `before`. */
void schedule_change(struct schedule_segment *seg, const struct schedule_segment *before,
                     const struct schedule_spec *spec, uint64_t k);

/* Returns the time of pulse k since the scan's start; k >= seg->k0. */
int64_t schedule_time_ns(const struct schedule_segment *seg, uint64_t k);
/* Sets num/den to the nanoseconds of a firing sequence, or of a pulse where there is no sequence. */
void schedule_sequence_ns(const struct schedule_segment *seg, uint64_t *num, uint64_t *den);
/* Returns the first pulse that fires at or after t_ns; at least seg->k0. */
uint64_t schedule_pulse_at(const struct schedule_segment *seg, int64_t t_ns);
/* Returns the line of pulse k. */
uint64_t schedule_line_of(const struct schedule_segment *seg, uint64_t k);
/* Fills `line` for line n of the segment, n >= line0. */
void schedule_get_line(const struct schedule_segment *seg, uint64_t n, struct schedule_line *line);

/* Returns the last pulse up to k where a packet may begin: a multiple of SCHEDULE_PACKET from the line's first
 * pulse. */
uint64_t schedule_cut(const struct schedule_segment *seg, uint64_t k);

/* Fills the run of pulses k .. k+n-1, all of `line`. */
void schedule_get_run(const struct schedule_segment *seg, const struct schedule_line *line, uint64_t k, uint32_t n,
                      struct schedule_run *run);

/* Returns the angle at pulse k of the axis that sweeps a line, in turns: a line head's mirror, the rotor of a head
 * of beams. */
double schedule_sweep_turn(const struct schedule_segment *seg, uint64_t k);
/* Changes a run of a line head, or of a head of beams: that axis stands still at sweep_turn. Lines go on by time. */
void schedule_hold_run(const struct schedule_segment *seg, double sweep_turn, struct schedule_run *run);

/* Returns a number of pulses that fire within max_ns for certain, or 1. The time from pulse to pulse is rounded up, so
 * a few more pulses may fire within max_ns. */
uint64_t schedule_longest_run(const struct schedule_segment *seg, int64_t max_ns);

/* These two functions return pan angle and mirror angle of any pulse, in turns, for the encoders. The pan angle is not
 * reduced to one turn. */
double schedule_pan_turn(const struct schedule_segment *seg, uint64_t k);
double schedule_mirror_turn(const struct schedule_segment *seg, uint64_t k);

#endif
