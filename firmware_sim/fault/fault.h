/* SPDX-License-Identifier: MIT */
/* An injected fault as data: what goes wrong, where, and when.
 *
 * In: a fault of the list, and a place where it may strike (a frame, a reply, a connection, a moment of the head).
 * Out: whether it strikes there, and random numbers that belong to that place. Pure; any thread.
 *
 * All numbers count from 1. Times are device time in seconds from power-up, or from the command that added the
 * fault. */
#ifndef FIRMWARE_SIM_FAULT_FAULT_H
#define FIRMWARE_SIM_FAULT_FAULT_H

#include <stddef.h>
#include <stdint.h>

enum { FAULT_MAX = 32 };

enum fault_kind {
#define KIND(kind, name) kind,
#include "firmware_sim/fault/kinds.h"
#undef KIND
    FAULT_N_KINDS
};

/* The place where a kind strikes. */
enum fault_place {
    FAULT_AT_FRAME,      /* at frames, or units */
    FAULT_AT_REPLY,      /* at replies */
    FAULT_AT_CONNECTION, /* at connections */
    FAULT_AT_MOMENT      /* in the head, in device time */
};

/* Frames of the stream, notices (telemetry, events, repetitions) and replies are numbered separately. A fault of frames
 * counts either frames of the stream or notices: the member `of` of struct fault says which. */
enum fault_of { FAULT_OF_STREAM, FAULT_OF_NOTICES, FAULT_OF_REPLIES, FAULT_N_OF };

struct fault {
    enum fault_kind kind;
    uint32_t link; /* from 1; 0: all that can have it */
    int of;        /* enum fault_of, without replies */
    /* when: all of these together */
    uint64_t at;          /* one number alone; 0: not given */
    uint64_t from, until; /* numbers; until 0: no end */
    uint64_t every;       /* from `from` on */
    double probability;
    /* The fault strikes at most so often; 0: no limit. The limit is for each session. For acts of the link
     * (fault_is_act), and for faults at connections, it is for the link. */
    uint64_t count;
    uint64_t from_pulse, until_pulse; /* of a scan, from 0; until UINT64_MAX: no end. Other frames have no pulses */
    double from_s, until_s;           /* until 0: no end */
    uint64_t seed;
    /* what: as the kinds say */
    uint32_t n;   /* 0: the kind's own */
    int64_t byte; /* from 0; -1: any */
    int reseal, reset;
    double for_ms;
    double factor, deg, hz, loss_db, jump_s, ppm, ns;
    uint64_t grandmaster; /* its identity */
    uint32_t clock_class;
};

struct fault_list {
    struct fault fault[FAULT_MAX];
    uint32_t n;
};

/* A place where faults may strike. */
struct fault_spot {
    uint64_t number; /* of the frame, reply or connection; 0: it has none */
    int64_t t_ns;    /* device time */
    int has_pulses;
    uint64_t pulse0, n_pulses; /* of the frame */
};

extern const char *const fault_names[]; /* by kind, NULL at the end */
enum fault_place fault_place_of(enum fault_kind kind);
/* Whether the kind is an act of the link, at a frame: disconnect to short_packets. */
int fault_is_act(enum fault_kind kind);
/* The kind by which a link carries out an act. acts: those that it can do; bit 0 is FAULT_DISCONNECT, and so on. For a
 * link that can't fall silent, a pulled cable is an unplugging. */
enum fault_kind fault_act_of(enum fault_kind kind, uint32_t acts);
/* Returns n; if that is 0, the default of the kind. */
uint32_t fault_n(const struct fault *fault);

/* Whether the fault strikes there, without regard to its count. index: the fault's number; link: the spot's. */
int fault_strikes(const struct fault *fault, uint32_t index, uint32_t link, const struct fault_spot *spot);
/* Returns a random number that belongs to fault and place; `draw` tells the draws of one place apart, from 1. */
uint64_t fault_random(const struct fault *fault, uint32_t index, uint32_t link, uint64_t number, uint32_t draw);

#endif
