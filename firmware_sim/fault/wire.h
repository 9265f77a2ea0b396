/* SPDX-License-Identifier: MIT */
/* The bytes of one session through the faults of its link.
 *
 * In: frames of the native protocol, units of another one, reply lines, in the order in which the session would write
 * them; the clock. Out: pieces to be written, with the time before which they must not go out, and acts that the owner
 * carries out on its link (to hang up, to unplug, and so on) when they are the first. Each fault that strikes is noted
 * on the board; what the link does, by the owner, once it has been done. Without faults a session has no wire.
 *
 * At a frame faults strike in this order: what ends the session; drop (and flips on datagrams, but for those that are
 * resealed); truncate; flips that are resealed; all others, as they stand in the list. A fault that finds nothing to do
 * there does not strike: it is not noted, nor counted. Examples are a flip of a byte that a short frame has not, and
 * anything but what stands before the frame when that is dropped.
 *
 * Thread: one, but for the board. Allocates. */
#ifndef FIRMWARE_SIM_FAULT_WIRE_H
#define FIRMWARE_SIM_FAULT_WIRE_H

#include "firmware_sim/fault/tally.h"
#include "firmware_sim/fault/wire_queue.h"

enum {
    WIRE_DELAY_BYTES = 8 << 20, /* that delays keep on their way */
    WIRE_HOLD_MS = 2000,        /* device time that a reordered or merging frame waits for others, at most */
};

struct wire;

struct wire_spec {
    struct fault_board *board;
    uint32_t link, session; /* from 1 */
    uint32_t max_unit;      /* the longest frame or unit, as a rule: room for it is there at once */
    int units;              /* 1: each unit is a write of its own */
    int native;             /* frames of the native protocol */
    int datagrams; /* 1: units with a checksum of the system's, which drops those that are damaged on their way */
    /* Of the protocol (protocol.h). */
    void (*content)(const uint8_t *unit, size_t len, uint8_t *mask);
    void (*reseal)(uint8_t *unit, size_t len);
    uint32_t acts;             /* what the link can do: bit 0 is FAULT_DISCONNECT, and so on; others don't strike */
    struct fault_tally *tally; /* of its acts, over all sessions of the link; outlives the wire. NULL: by session */
};

/* NULL: no memory. */
struct wire *wire_create(const struct wire_spec *spec);
void wire_free(struct wire *wire);

/* What a session would write. t_ns: device time. Native frames say themselves what time and counting they are of. */
struct wire_item {
    int of; /* enum fault_of */
    const uint8_t *bytes;
    size_t len;
    int64_t t_ns;
};
/* Returns 0, or SH_ENOMEM: it is lost, or part of it. */
int wire_put(struct wire *wire, const struct wire_item *item, int64_t now_ns);
/* The rest of a frame, unit or reply that was begun without the wire: goes out as it is, and is not counted. */
int wire_put_rest(struct wire *wire, const uint8_t *bytes, size_t len);
/* The act that should have ended the session could not be carried out: what was put since then is lost. */
void wire_go_on(struct wire *wire);
/* A command of this session changed the list: its new faults count from here, after `ahead` replies, those to lines
 * up to that one, which are still to be put. Otherwise they count from the next item. */
void wire_renew(struct wire *wire, uint64_t ahead);
/* All items from before device time t_ns were put. */
int wire_time(struct wire *wire, int64_t t_ns);
/* What the client sent: what an echo sends back with the reply to it. */
void wire_heard(struct wire *wire, const void *bytes, size_t len);
/* So many replies are still to be put to lines that it did not hear. */
void wire_skip_heard(struct wire *wire, uint32_t n);

/* What its owner notes of an act on the board, once it is carried out. Valid as the act is. */
const struct fault_note *wire_act_note(const struct wire_piece *act);

/* The first piece, or act, if it may go out now; NULL: none may. Its bytes from `out` on are to be written, which the
 * owner moves on. last: no more items come, nothing is held for them. */
struct wire_piece *wire_due(struct wire *wire, int64_t now_ns, int last);
/* When the next one may; INT64_MAX: there is none. */
int64_t wire_next_ns(const struct wire *wire);
void wire_pop(struct wire *wire);
/* Whether as much waits as the owner keeps, which is cap bytes, or WIRE_DELAY_BYTES while frames are delayed. What
 * waits for frames to come does not count. */
int wire_is_full(const struct wire *wire, size_t cap, int64_t now_ns);
int wire_is_empty(const struct wire *wire);
/* Whether a fault keeps the next piece back: a stall that is on or begins now, or a time that is still to come. */
int wire_keeps_back(const struct wire *wire, int64_t now_ns);
/* What was put and not written as a whole: frames of the stream (not made for this reader alone) or units, and pulses
 * in them. What a fault dropped counts as written; what comes after an act that ends the session does not. */
void wire_count_unwritten(const struct wire *wire, uint64_t *frames, uint64_t *pulses);

#endif
