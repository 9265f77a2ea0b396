/* SPDX-License-Identifier: MIT */
/* The wire of one session: injects the faults of its link into the session's bytes.
 *
 * In: frames of the native protocol, units of another one, reply lines, in the order in which the session would write
 * them; the clock. Out: pieces to be written, each with the time before which it must not go out; and acts (to hang up,
 * to unplug, and so on), which the owner carries out on its link once they are first in the queue. The wire notes on
 * the board each fault that strikes. The owner notes an act once it is carried out. Without faults there is no wire.
 *
 * At a frame faults strike in this order: acts that end the session, and a pulled cable; drop, and on datagrams flips
 * without reseal; truncate; flips with reseal; all others, in the order of the list. A fault that finds nothing to do
 * there does not strike: it is not noted, nor counted. One example is a flip of a byte beyond the end of a short frame.
 * Another is a dropped frame: only faults that act before the frame strike there.
 *
 * Thread: one. Any thread may use the board. Allocates. */
#ifndef FIRMWARE_SIM_FAULT_WIRE_H
#define FIRMWARE_SIM_FAULT_WIRE_H

#include "firmware_sim/fault/tally.h"
#include "firmware_sim/fault/wire_heard.h"
#include "firmware_sim/fault/wire_queue.h"

enum {
    WIRE_DELAY_BYTES = 8 << 20, /* most bytes that delays hold */
    WIRE_HOLD_MS = 2000,        /* most device time that a reordered or merging frame waits for others */
};

struct wire;

struct wire_spec {
    struct fault_board *board;
    uint32_t link, session; /* from 1 */
    uint32_t max_unit;      /* the usual longest frame or unit: room for it is allocated at once */
    int units;              /* 1: another protocol; each of its units counts as a frame */
    int native;             /* frames of the native protocol */
    int datagrams;          /* 1: the system adds a checksum to each unit, and its receiver drops damaged ones */
    /* The protocol's functions (protocol.h). */
    void (*content)(const uint8_t *unit, size_t len, uint8_t *mask);
    void (*reseal)(uint8_t *unit, size_t len);
    uint32_t acts;             /* acts that the link can do: bit 0 is FAULT_DISCONNECT, and so on; no others strike */
    struct fault_tally *tally; /* counts acts, for all sessions of the link; it outlives them. NULL: each wire counts */
    struct wire_heard *heard;  /* what the client sent, for echoes; outlives the wire */
};

/* NULL: no memory. */
struct wire *wire_create(const struct wire_spec *spec);
/* Acts that were not carried out no longer count in the tally. */
void wire_free(struct wire *wire);

/* A frame, unit or reply that the session would write. t_ns: device time. Native frames have their own time and
 * counting in their headers. */
struct wire_item {
    int of; /* enum fault_of */
    const uint8_t *bytes;
    size_t len;
    int64_t t_ns;
};
/* Returns 0, or SH_ENOMEM: the item is lost, or part of it. */
int wire_put(struct wire *wire, const struct wire_item *item, int64_t now_ns);
/* Puts the rest of a frame, unit or reply that was begun without the wire. The rest goes out as it is, and is not
 * counted. */
int wire_put_rest(struct wire *wire, const uint8_t *bytes, size_t len);
/* An act that should have ended the session could not be carried out. Items that were put since then are lost. */
void wire_go_on(struct wire *wire);
/* A command of this session changed the list. The next `ahead` replies answer the lines up to that command: new faults
 * count only the replies after these. They count all other items from the next one on. */
void wire_renew(struct wire *wire, uint64_t ahead);
/* All items from before device time t_ns were put. INT64_MAX: no more items come, so none is waited for. */
int wire_time(struct wire *wire, int64_t t_ns);

/* Returns the note that the owner puts on the board once it has carried out an act. Valid as long as the act. */
const struct fault_note *wire_act_note(const struct wire_piece *act);

/* The first piece or act, if it may go out now; else NULL. The owner writes the piece's bytes from `out` on, and moves
 * `out`. */
struct wire_piece *wire_due(struct wire *wire, int64_t now_ns);
/* Returns when the next one may go out; INT64_MAX: there is none. */
int64_t wire_next_ns(const struct wire *wire);
void wire_pop(struct wire *wire);
/* Whether cap bytes wait, or WIRE_DELAY_BYTES while frames are delayed. Pieces held for later frames don't count. */
int wire_is_full(const struct wire *wire, size_t cap, int64_t now_ns);
int wire_is_empty(const struct wire *wire);
/* Whether a fault holds back the next piece: a stall that is on or begins now, or a time that is still to come. */
int wire_keeps_back(const struct wire *wire, int64_t now_ns);
/* Counts frames of the stream, or units, that were put and not wholly written, and their pulses. Frames for this reader
 * alone are left out. Dropped frames count as written. Frames after an act that ends the session count as unwritten. */
void wire_count_unwritten(const struct wire *wire, uint64_t *frames, uint64_t *pulses);

#endif
