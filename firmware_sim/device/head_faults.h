/* SPDX-License-Identifier: MIT */
/* Faults in the head: which of them are at work in a tick, when each begins and ends, and the notes of that.
 *
 * In: the board of the run, and each tick as it is claimed. Out: the faults that are at work in it. A fault that begins
 * is noted on the board once, with device time and the first pulse that it hits where a scan is on; and once more, as
 * ended, when it is over. All goes by device time, so it is the same at any pace and with any number of threads.
 *
 * A fault begins with the first tick that starts at from_s or later, and ends with the first that starts at until_s or
 * later, as commands do. The clock's faults are exact to the nanosecond instead. With from_pulse or until_pulse it is
 * at work in ticks of a scan that have such a pulse. A power cycle, a jump and a leap second strike once; power is off
 * for for_ms, up to a whole tick. What is taken out of the list while it is at work ends.
 *
 * Those that change what is measured are no part of it: they are exact to the pulse (beam_faults.c).
 *
 * Thread: whoever has the device's lock. Without faults a step is one atomic load. */
#ifndef FIRMWARE_SIM_DEVICE_HEAD_FAULTS_H
#define FIRMWARE_SIM_DEVICE_HEAD_FAULTS_H

#include "firmware_sim/fault/board.h"

/* A set of kinds. */
#define HEAD_FAULT(kind) (UINT64_C(1) << (kind))
#define HEAD_FAULTS_CLOCK                                                                          \
    (HEAD_FAULT(FAULT_CLOCK_JUMP) | HEAD_FAULT(FAULT_CLOCK_DRIFT) | HEAD_FAULT(FAULT_CLOCK_STOP) | \
     HEAD_FAULT(FAULT_PPS_LOST) | HEAD_FAULT(FAULT_LEAP_SECOND))
#define HEAD_FAULTS_ONCE (HEAD_FAULT(FAULT_POWER_CYCLE) | HEAD_FAULT(FAULT_CLOCK_JUMP) | HEAD_FAULT(FAULT_LEAP_SECOND))
#define HEAD_FAULTS_BEAM                                                                                \
    (HEAD_FAULT(FAULT_MIRROR_SLOW) | HEAD_FAULT(FAULT_MIRROR_STUCK) | HEAD_FAULT(FAULT_MIRROR_WOBBLE) | \
     HEAD_FAULT(FAULT_PAN_SLIP) | HEAD_FAULT(FAULT_LASER_OFF) | HEAD_FAULT(FAULT_WINDOW_SOILED))
_Static_assert(FAULT_N_KINDS <= 64, "a set of kinds has a bit for each");

struct head_fault {
    uint32_t number; /* on the board; first, for fault_find */
    struct fault fault;
    int64_t from_ns, until_ns; /* device time; INT64_MAX: no end */
    int active;                /* in the tick of the last step */
    int begins, ends;          /* with the last step */
    int64_t begin_ns;          /* when it last began */
    uint32_t times;            /* it began, so far */
    int cleared;               /* it was taken out of the list: it ends with the next step */
    /* its owner's: */
    uint64_t n; /* for the note of its end: PPS events that were lost, ...; 0 when it begins */
    int undone; /* what it did is undone already; 0 when it begins */
};

struct head_faults {
    struct fault_board *board;
    int64_t tick_ns;
    uint32_t version;
    uint32_t n;
    struct head_fault fault[2 * FAULT_MAX]; /* those that were just taken out, too */
};

/* A tick. */
struct head_faults_tick {
    int64_t t_ns; /* its start */
    int has_pulses;
    uint64_t pulse0, n_pulses; /* of the scan that is on; n_pulses may be 0 */
};

void head_faults_init(struct head_faults *faults, struct fault_board *board, int64_t tick_ns);

/* Ticks come in order. Faults of these kinds begin and end; each kind belongs to one step of a tick. Returns 1 when one
 * of them is active or has just ended. */
int head_faults_step(struct head_faults *faults, uint64_t kinds, const struct head_faults_tick *tick);

/* The faults of a kind that are active, one after the other; from NULL to NULL. */
struct head_fault *head_faults_next(struct head_faults *faults, enum fault_kind kind, const struct head_fault *before);

/* The faults of a kind that strikes at something, as a boot, whose window has this moment. In the same way, after a
 * step of this tick. They are in no step themselves: who makes them strike notes them. */
struct head_fault *head_faults_at(struct head_faults *faults, enum fault_kind kind, int64_t t_ns,
                                  const struct head_fault *before);
/* A note: text may be NULL; without a pulse. */
void head_faults_note(struct head_faults *faults, const struct head_fault *fault, int64_t t_ns, int ended,
                      const char *text);

#endif
