/* From native frames to whole scans: a turn of a planar head, with the ranges and signals of each step.
 *
 * A scan is done when each step that is cast has its pulse, and where the stream has attributes each point its own. A
 * turn of which something is missing never becomes a scan; it is counted. Nothing is allocated. */
#ifndef DRIVERS_PROTOCOL_COLA_SCAN_H
#define DRIVERS_PROTOCOL_COLA_SCAN_H

#include <stddef.h>
#include <stdint.h>

#include "drivers/protocol/native.h"

enum { COLA_MAX_POINTS = 3000 };
enum cola_echo { COLA_FIRST, COLA_SECOND, COLA_LAST, COLA_N_ECHOES };

/* What descriptor and emitter frames say of the head. Angles are SICK's: 0 is right, 90 deg forward, counted
 * counter-clockwise seen from above. Beam 0 has the smallest angle. */
struct cola_geometry {
    int known;           /* there was a descriptor */
    int fits;            /* it is a planar head of at most COLA_MAX_POINTS beams */
    uint32_t steps;      /* a turn */
    uint32_t n;          /* beams */
    int32_t first;       /* step that is cast first */
    int32_t front;       /* step that looks forward */
    int turn;            /* +1: steps go clockwise */
    int32_t start_e4;    /* of beam 0, 1/10000 deg */
    uint32_t scan_chz;   /* scans, 1/100 Hz */
    uint32_t meas_100hz; /* pulses, 100 Hz */
    double counts_per_turn, mm_per_count;
    uint32_t scale; /* mm that one count of a distance is: 1, or 2 where the reach is over 65.535 m */
};
/* Angle of a beam, 1/10000 deg, rounded. */
int32_t cola_beam_angle(const struct cola_geometry *g, uint32_t beam);

struct cola_scan {
    int64_t t0_ns;    /* device time of step 0 */
    uint16_t counter; /* turns of the head; goes on where one was lost */
    int32_t path_mm;  /* a head that moves: its way since the scan began, or the client came; else 0 */
    int16_t speed_mm_s;
    uint32_t range[COLA_N_ECHOES][COLA_MAX_POINTS];  /* counts of the stream; 0: none */
    uint16_t signal[COLA_N_ECHOES][COLA_MAX_POINTS]; /* of COLA.md's RSSI scale, 16 bit; 0: none, or not modelled */
    uint8_t got[COLA_MAX_POINTS];
};

struct cola_collector {
    struct cola_geometry geometry;
    struct cola_scan scan[2], *now, *last; /* being filled; done, NULL: none yet */
    uint64_t lost;                         /* turns of which something was missing; the caller takes and clears it */
    /* the stream */
    int has_attributes, have_line, line_is_open, line_joined;
    int present; /* lines have been seen: what is missing from now on is lost */
    uint32_t scan_number, line, counter0;
    uint32_t n_got, n_points, n_attributes; /* of the open line */
    struct native_points points;            /* the frame before, for its attributes */
    int points_wait;
    uint16_t beam_of[NATIVE_MAX_POINTS]; /* of its points */
    uint8_t echo_of[NATIVE_MAX_POINTS];
    /* how far the head has come */
    int have_pose;
    int64_t pose_t0_ns, pose_t1_ns;
    double pose_m[3], path0_m, path1_m;
};

void cola_collect_init(struct cola_collector *c);
/* A whole native frame. 1: a scan is done, c->last. */
int cola_collect(struct cola_collector *c, const uint8_t *frame);

#endif
