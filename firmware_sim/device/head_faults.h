/* SPDX-License-Identifier: MIT */
/* Injected faults in the head: finds those that are active in a tick, and notes when each begins and ends.
 *
 * In: the board of the run, and each tick as it is claimed. Out: the faults that are active in it. A fault is noted on
 * the board when it begins, with device time and, during a scan, the first pulse that it hits. The fault is noted
 * again, as ended, when it is over; jumps and leap seconds have no end. Everything depends on device time only, so it
 * is the same at any pace and number of threads.
 *
 * A fault begins with the first tick that starts at from_s or later, and ends with the first that starts at until_s or
 * later, as commands do. The clock's faults are exact to the nanosecond instead. With from_pulse or until_pulse a fault
 * is active in ticks of a scan that have such a pulse. A power cycle, a jump and a leap second strike once; power is
 * off for for_ms, rounded up to a whole tick. A fault that is taken out of the list while it is active ends.
 *
 * Faults that change what is measured are not handled here: they are exact to the pulse (beam_faults.c).
 *
 * Thread: with the device's lock. Without faults a step is one atomic load. */
#ifndef FIRMWARE_SIM_DEVICE_HEAD_FAULTS_H
#define FIRMWARE_SIM_DEVICE_HEAD_FAULTS_H

#include "firmware_sim/fault/board.h"

/* A set of kinds. */
#define HEAD_FAULT(kind) (UINT64_C(1) << (kind))
/* These faults put the clock into holdover, in which it gains the fault's `ppm`. */
#define HEAD_FAULTS_HOLDOVER (HEAD_FAULT(FAULT_PTP_LOST) | HEAD_FAULT(FAULT_PTP_NO_SYNC) | HEAD_FAULT(FAULT_PTP_FAULTY))
#define HEAD_FAULTS_PTP                                                                      \
    (HEAD_FAULTS_HOLDOVER | HEAD_FAULT(FAULT_PTP_GRANDMASTER) | HEAD_FAULT(FAULT_PTP_STEP) | \
     HEAD_FAULT(FAULT_PTP_ASYMMETRY) | HEAD_FAULT(FAULT_PTP_JITTER))
#define HEAD_FAULTS_CLOCK                                                                          \
    (HEAD_FAULT(FAULT_CLOCK_JUMP) | HEAD_FAULT(FAULT_CLOCK_DRIFT) | HEAD_FAULT(FAULT_CLOCK_STOP) | \
     HEAD_FAULT(FAULT_PPS_LOST) | HEAD_FAULT(FAULT_PPS_JITTER) | HEAD_FAULT(FAULT_NMEA_LOST) |     \
     HEAD_FAULT(FAULT_NMEA_LATE) | HEAD_FAULT(FAULT_NMEA_VOID) | HEAD_FAULT(FAULT_NMEA_CHECKSUM) | \
     HEAD_FAULT(FAULT_LEAP_SECOND) | HEAD_FAULTS_PTP)
/* These faults strike at answers of a time server. */
#define HEAD_FAULTS_SERVER                                                                      \
    (HEAD_FAULT(FAULT_NTP_SILENT) | HEAD_FAULT(FAULT_NTP_KISS) | HEAD_FAULT(FAULT_NTP_UNSYNC) | \
     HEAD_FAULT(FAULT_NTP_STEP))
#define HEAD_FAULTS_ONCE (HEAD_FAULT(FAULT_POWER_CYCLE) | HEAD_FAULT(FAULT_CLOCK_JUMP) | HEAD_FAULT(FAULT_LEAP_SECOND))
#define HEAD_FAULTS_BEAM                                                                                \
    (HEAD_FAULT(FAULT_MIRROR_SLOW) | HEAD_FAULT(FAULT_MIRROR_STUCK) | HEAD_FAULT(FAULT_MIRROR_WOBBLE) | \
     HEAD_FAULT(FAULT_PAN_SLIP) | HEAD_FAULT(FAULT_LASER_OFF) | HEAD_FAULT(FAULT_WINDOW_SOILED))
_Static_assert(FAULT_N_KINDS <= 64, "a set of kinds has a bit for each");

struct head_fault {
    uint32_t number; /* on the board; first member, for fault_find */
    struct fault fault;
    int64_t from_ns, until_ns; /* device time; INT64_MAX: no end */
    int active;                /* in the tick of the last step */
    int begins, ends;          /* with the last step */
    int64_t begin_ns;          /* when it last began */
    uint32_t times;            /* how often it began so far */
    int cleared;               /* it was taken out of the list: it ends with the next step */
    /* its owner's: */
    uint64_t n; /* for the note of its end, such as the number of PPS events that were lost; 0 when it begins */
    int undone; /* its effect is undone already; 0 when it begins */
};

struct head_faults {
    struct fault_board *board;
    int64_t tick_ns;
    uint32_t version;
    uint32_t n;
    struct head_fault fault[2 * FAULT_MAX]; /* including those that were just taken out */
};

/* A tick. */
struct head_faults_tick {
    int64_t t_ns; /* its start */
    int has_pulses;
    uint64_t pulse0, n_pulses; /* of the scan that is on; n_pulses may be 0 */
};

void head_faults_init(struct head_faults *faults, struct fault_board *board, int64_t tick_ns);

/* Begins and ends faults of these kinds. A tick may have several such steps, each for other kinds. Ticks come in order.
 * Returns 1 when one of the faults is active or has just ended. */
int head_faults_step(struct head_faults *faults, uint64_t kinds, const struct head_faults_tick *tick);

/* Returns the next active fault of a kind in the list after `before`; NULL: the first. Returns NULL after the last. */
struct head_fault *head_faults_next(struct head_faults *faults, enum fault_kind kind, const struct head_fault *before);

/* Does the same for a kind that strikes at an event, such as a boot. The event is at t_ns: the function returns faults
 * whose time from from_s to until_s includes t_ns. Call it after a step of this tick. Such kinds are in no step
 * themselves: the caller that makes such a fault strike notes it. */
struct head_fault *head_faults_at(struct head_faults *faults, enum fault_kind kind, int64_t t_ns,
                                  const struct head_fault *before);
/* Puts a note on the board, without a pulse. */
void head_faults_note(struct head_faults *faults, const struct head_fault *fault, int64_t t_ns, int ended);

#endif
