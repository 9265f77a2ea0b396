/* SPDX-License-Identifier: MIT */
/* Native frames of a planar head go in, whole turns come out: the echoes of each step, and the time of step 0.
 *
 * Steps are numbered counter-clockwise seen from above, first..last; those of a head that turns clockwise are
 * numbered backward. A place is a step's number less `first`: 0..n-1.
 *
 * A turn is whole once each place has its pulse, and its attributes where the head sends them: that is when the
 * beam has passed the last step. A turn with something missing is broken: it never comes out, and is counted. A turn
 * is not counted if within it the first frame came, the scan ended, the steps changed or a replay jumped.
 *
 * Pure. Nothing is allocated; real-time safe. */
#ifndef DRIVERS_PROTOCOL_PLANAR_SCAN_H
#define DRIVERS_PROTOCOL_PLANAR_SCAN_H

#include "core/err.h"
#include "drivers/protocol/native.h"

enum {
    PLANAR_MAX_STEPS = 3000,         /* steps that are cast in a turn */
    PLANAR_MAX_TURN = INT32_MAX / 4, /* steps of a turn: four times as many still fit into an int32_t */
    PLANAR_ECHOES = 4,               /* kept of a step: where it has more, the first three and the last */
    PLANAR_UNSEEN = 0xff,
};

/* A head as descriptor and emitter frames describe it. */
struct planar_head {
    int known;         /* 0: none came, or it is not planar, or has more steps than fit. The rest is then void */
    uint32_t steps, n; /* steps of a turn; those that are cast */
    int32_t first, last, front; /* steps; front looks along y and may lie outside of first..last */
    uint64_t lines_uhz, prr_uhz;
    double range_min_m, range_max_m, m_per_count;
    int attributes; /* points have amplitudes, unless these are not modelled */
};

struct planar_echo {
    uint32_t range; /* counts of the stream */
    int16_t refl_cdb, amplitude_cdb;
};

struct planar_turn {
    int64_t t0_ns;               /* device time of step 0 */
    int64_t scan_t0_ns;          /* of its scan's start; a recording may begin later */
    int64_t scan_came_ns;        /* of its scan's first frame that came; each round of a recording is a scan */
    uint32_t number;             /* turns before it, in its scan and in earlier ones, lost turns included */
    uint8_t n[PLANAR_MAX_STEPS]; /* echoes of each place, PLANAR_ECHOES at most; PLANAR_UNSEEN: no pulse came */
    struct planar_echo echo[PLANAR_MAX_STEPS][PLANAR_ECHOES]; /* in order of range */
};

struct planar_scan {
    struct planar_head head;
    const struct planar_turn *whole; /* the last whole turn; NULL: none with these steps came yet */
    int64_t t0_ns;                   /* of step 0 of the turn at hand or the last one; INT64_MIN: none yet */
    uint32_t scan;                   /* the head's number of the scan at hand */
    /* the members below are for planar_scan.c alone */
    struct planar_turn *now; /* being filled: the one that is not `whole` */
    struct native_emitter emitter;
    uint32_t line, number0;           /* number0: turns of the scans before */
    int64_t scan_t0_ns, scan_came_ns; /* see planar_turn */
    int seen, fresh, done; /* a turn was seen; pulses missed so far are no loss; the present turn needs no more */
    uint32_t n_seen;       /* places that have their pulse */
    double pan_counts, steps_per_count;
    uint32_t pan0_place; /* where pan count 0 is, 0..steps-1 */
    /* the last points frame, whose attributes come next */
    uint64_t pulse0;
    uint32_t n_waiting;             /* points that have no attributes yet */
    uint16_t at[NATIVE_MAX_POINTS]; /* place * PLANAR_ECHOES + echo; UINT16_MAX: no place */
    struct planar_turn turn[2];     /* the last member: large, and not touched before a turn begins */
};

/* The effects of one frame. `whole` and `broken` may concern different turns. */
struct planar_news {
    int begun, whole; /* a turn began; one is whole */
    uint32_t broken;  /* turns */
};

/* For protocol_ops.check_head of devices whose steps are numbered up to max_steps - 1. pan_counts: of a turn. */
int planar_scan_check(double pan_counts, const struct native_emitter *e, uint32_t max_steps, struct sh_err *err);
void planar_scan_init(struct planar_scan *s);
/* One frame of the stream. */
struct planar_news planar_scan_frame(struct planar_scan *s, const uint8_t *frame);

#endif
