/* Native frames of a planar head go in, whole scans of its steps come out.
 *
 * A scan is a turn of the head: the steps first..last, each with up to three echoes. It is whole once every
 * step has come, with its attributes where the head sends them: that is when the beam has passed the last
 * step. A turn of which something is missing is broken. Steps are counted as SCIP does, counter-clockwise
 * seen from above; those of a head that turns the other way are numbered backward. Pure. */
#ifndef DRIVERS_PROTOCOL_SCIP_SCAN_H
#define DRIVERS_PROTOCOL_SCIP_SCAN_H

#include "drivers/protocol/native.h"
#include "drivers/protocol/scip_reply.h"

enum { SCIP_UNSEEN = 0xff, SCIP_LEVEL_NONE = INT16_MIN };

struct scip_step {
    uint32_t range_mm[SCIP_MAX_ECHOES]; /* the nearest first */
    int16_t level_cdb[SCIP_MAX_ECHOES]; /* amplitude or reflectance, 0.01 dB; SCIP_LEVEL_NONE */
    uint8_t n;                          /* echoes; SCIP_UNSEEN */
};

struct scip_scan {
    /* of the head; `known` is 0 before its frames came, and where it is not planar or has too many steps */
    int known;
    int32_t first, last, front; /* steps; front may lie outside */
    uint32_t steps;             /* a turn */
    uint64_t lines_uhz;
    uint32_t min_mm, max_mm;
    int amplitudes; /* level_cdb are amplitudes */
    /* the turn at hand, or the last one */
    int64_t t0_ns;                         /* device time of step 0 */
    struct scip_step step[SCIP_MAX_STEPS]; /* by number */
    /* inside */
    struct native_emitter emitter;
    double pan_counts, range_scale_mm;
    uint32_t scan, line, n_seen;
    uint64_t pulse0;
    int in_turn, done;              /* a turn was begun; it is whole, broken or partial already */
    uint32_t n_points;              /* that wait for their attributes */
    uint16_t at[NATIVE_MAX_POINTS]; /* step and echo of each: step * 4 + echo; UINT16_MAX: none */
};

struct scip_turns {
    int whole;       /* the turn at hand is */
    uint32_t broken; /* turns before it of which something is missing */
};

void scip_scan_init(struct scip_scan *s);
/* One frame of the stream. */
struct scip_turns scip_scan_frame(struct scip_scan *s, const uint8_t *frame);

#endif
