/* SPDX-License-Identifier: MIT */
/* The head as a follower of a receiver's pulses per second, called pulses here, and of its sentences: the state of the
 * pulses, and the counter of time since the top of the hour that data and position packets carry (VLP-16 User Manual,
 * appendix G).
 *
 * In: each pulse and each sentence as it arrives, in order of time, with the head's own clock at that moment. Out: the
 * state of the pulses and the counter, at a device time.
 *
 * Pulses are absent where none came for more than a second and PPS_TOLERANCE_NS. A pulse agrees when the head's
 * clock has counted a whole number of seconds since the pulse before, within PPS_TOLERANCE_NS for each second. Any
 * other pulse but the first is an error. Pulses are locked after PPS_TO_LOCK pulses in a row that agreed, a second
 * apart.
 *
 *     power comes        the counter begins with hour_ns, and goes on by the head's own clock
 *     -> locked pulse    the counter's part of a second becomes 0
 *     -> sentence        the counter gets the minutes and seconds of the sentence
 *
 * While pulses aren't locked, neither pulses nor sentences set the counter: it goes on by the head's clock. While
 * pulses are locked but sentences are missing, the counter's minutes and seconds are counted on, and pulses set the
 * counter's part of a second. The last PPS_KEPT changes are kept, since sessions ask for past times. Pure; the owner
 * has the lock. */
#ifndef FIRMWARE_SIM_DEVICE_PPS_H
#define FIRMWARE_SIM_DEVICE_PPS_H

#include <stdint.h>

#include "drivers/protocol/protocol.h"

enum { PPS_KEPT = 64, PPS_TO_LOCK = 2, PPS_TOLERANCE_NS = 1000000 /* 1000 ppm: more than any oscillator is off */ };

/* A moment: device time, and what the head's clock shows then. */
struct pps_moment {
    int64_t t_ns, head_ns;
};

struct pps_state {
    struct pps_moment from, pulse; /* of this change; of the last pulse before or at it */
    int has_pulse;                 /* one has come since power-up */
    enum protocol_pps state;
    int run;         /* pulses that agreed, without a gap */
    int64_t hour_ns; /* of the counter at `from` */
};

struct pps {
    uint32_t n; /* so far; the last PPS_KEPT are kept */
    struct pps_state kept[PPS_KEPT];
};

/* Power comes, and the counter begins with hour_ns. pulses: 1: synchronising; 0: absent. */
void pps_power_up(struct pps *pps, struct pps_moment at, int64_t hour_ns, int pulses);
void pps_take(struct pps *pps, struct pps_moment edge);
/* A sentence came that names this second of the hour, 0..3600. */
void pps_take_sentence(struct pps *pps, struct pps_moment at, int64_t second);
/* Returns the state at `at`, and the counter then, 0..3599999999999. Before power-up: absent, and 0. */
enum protocol_pps pps_at(const struct pps *pps, struct pps_moment at, int64_t *hour_ns);

#endif
