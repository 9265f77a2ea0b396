/* SPDX-License-Identifier: MIT */
/* The ledger of a link: for each frame the injected faults, and what the client saw of them. */
#ifndef FIRMWARE_SIM_APP_STUDIO_SOAK_LEDGER_H
#define FIRMWARE_SIM_APP_STUDIO_SOAK_LEDGER_H

#include <stdint.h>

#include "drivers/host/scanhead.h"
#include "firmware_sim/app/studio/soak/frame.h"
#include "firmware_sim/fault/board.h"

struct soak_link;

enum { SOAK_MAX_RUNS = 1024, SOAK_MAX_ACTS = 64 };

/* Marks of a frame: it is missing; there was no session then; it went into one datagram with others. */
enum { SOAK_GAP = 1, SOAK_AWAY = 2, SOAK_MERGED = 4 };

/* A frame of a link. */
struct soak_fact {
    soak_seq seq;
    int there;
    unsigned marks;
    /* what the client saw */
    uint64_t digest;
    uint32_t got, repeated, late;
    int64_t after_ns; /* clock at its arrival, minus its own device time; link->offset_ns is the smallest of these */
    /* what was done to it */
    int64_t t_ns;
    uint8_t times[FAULT_REFUSE]; /* by kind */
    uint8_t resealed;
    uint32_t copies, behind, garbage;
    uint32_t cut_to; /* bytes that truncation left; 0: all */
    double for_ms;   /* delay, jitter and stall: the longest */
};

/* Bytes that belong to no frame, or a frame with a wrong payload. t_ns: device time of that frame; for bytes, of the
 * last whole frame before them. */
struct soak_run {
    int64_t t_ns;
    uint64_t n;
};

/* A fault that ends the connection, or refuses one. */
struct soak_act {
    enum fault_kind kind;
    int64_t t_ns; /* device time */
};

/* The board of faults calls this for each fault. */
void soak_heard(void *soak, const struct fault_note *note);
void soak_saw_frame(struct soak_link *link, const struct scanhead_frame *frame, int64_t now_ns);
/* A datagram; the caller has the link's lock. */
void soak_saw_unit(struct soak_link *link, soak_seq seq, uint64_t digest, uint32_t len);
void soak_saw_notice(void *link, const struct scanhead_notice *notice);
void soak_saw_open(struct soak_link *link);                           /* a connection began */
void soak_saw_end(struct soak_link *link);                            /* it ended */
void soak_saw_no_open(struct soak_link *link);                        /* an attempt to connect failed */
void soak_saw_none(struct soak_link *link, soak_seq top);             /* the stream is at top, without a connection */
struct soak_fact *soak_fact_at(struct soak_link *link, soak_seq seq); /* NULL: not known */

#endif
