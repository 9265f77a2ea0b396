/* SPDX-License-Identifier: MIT */
/* A client's questions, whose right answers are known, and the judging of the answers. */
#ifndef FIRMWARE_SIM_APP_STUDIO_SOAK_ASK_H
#define FIRMWARE_SIM_APP_STUDIO_SOAK_ASK_H

#include <stdint.h>

#include "firmware_sim/fault/board.h"

struct soak_link;

enum { SOAK_MAX_REPLY_NOTES = 16, SOAK_REPLY_LEN = 600 };

struct soak_ask {
    int active;   /* a question is out */
    int settling; /* the library first resynchronises, with questions of its own */
    uint32_t n;   /* faults that hit replies since the question went out */
    struct fault_note note[SOAK_MAX_REPLY_NOTES];
    uint32_t echoes;             /* noticed since then */
    uint64_t bad_bytes;          /* likewise */
    uint64_t others;             /* faults of any other kind since then */
    int64_t ended_ns;            /* clock: when a session last ended, or a client was turned away; 0: not yet */
    char before[SOAK_REPLY_LEN]; /* the last reply that came */
    /* hurt: replies lost or wrong beside another fault, or just after a session; odd: without such a reason */
    uint64_t asked, answered, timeouts, wrong, hurt, odd;
    uint32_t next;
};

/* Asks the next question, and judges its answer. */
void soak_ask_next(struct soak_link *link);
/* Asks for the head's state; starts a scan where it is idle, and resets it where it is in fault. */
void soak_ask_scan(struct soak_link *link);

#endif
