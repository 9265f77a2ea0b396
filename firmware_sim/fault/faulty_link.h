/* SPDX-License-Identifier: MIT */
/* A link with injected faults: a decorator of any link, with link_ops around link_ops (drivers/link/link.h).
 *
 * In: the calls of the link's owner. Out: the same calls on the inner link, with the faults of a board. The faults
 * change the bytes of sessions, end sessions, turn clients away, and take the link away for a time. As long as the
 * board never had a fault, calls only pass through.
 *
 * From the first fault on, each session has a wire (wire.h). A wire that stalls holds as many bytes as a session's
 * buffer; one that delays holds WIRE_DELAY_BYTES. A wire that is full makes write() take nothing, so its reader counts
 * as too slow. Bytes in the wire when the client goes away, or at the end of the run, are not written; faulty_forget
 * counts them. Frames that a fault dropped or changed count as written.
 *
 * A wire needs to know more than link_ops can say. The functions below are for that. Thread: as link.h says. */
#ifndef FIRMWARE_SIM_FAULT_FAULTY_LINK_H
#define FIRMWARE_SIM_FAULT_FAULTY_LINK_H

#include "drivers/link/link.h"
#include "drivers/protocol/protocol.h"
#include "firmware_sim/fault/board.h"

struct faulty_spec {
    struct fault_board *board;           /* NULL: no faults strike here */
    uint32_t number;                     /* of the link, from 1 */
    uint32_t first_session;              /* number of its first session */
    const struct protocol_ops *protocol; /* of the link */
    size_t room;                         /* bytes that a stalled wire holds */
    /* called by the link's thread */
    void *owner;
    int64_t (*time_ns)(void *owner);                            /* device time now */
    int (*is_off)(void *owner);                                 /* the head has no power now */
    void (*say)(void *owner, const char *text);                 /* prints a line for the person who runs the head */
    void *source;                                               /* source.h */
    void (*report)(void *source, int number, const char *text); /* into the error queue */
};

struct faulty_link;

/* Opens the link, and puts itself around it. */
int faulty_open(const struct faulty_spec *faults, const struct link_spec *spec, struct faulty_link **out,
                struct sh_err *err);
/* Returns the operations of this link; members that the inner one lacks are NULL here, too. */
const struct link_ops *faulty_ops(const struct faulty_link *link);

/* Whether there is an injected fault, or there was one. */
int faulty_is_on(const struct faulty_link *link);
/* The next write of the session is a unit of this kind. t_ns: device time. Needed where the protocol is not native;
 * native bytes say it themselves. */
void faulty_next(struct faulty_link *link, int session, int is_reply, int64_t t_ns);
/* All bytes from before device time t_ns were written to the session; INT64_MAX: none will follow. Passes on what is
 * due. Returns 1 if write() takes more; 0: not now; negative: as write(). */
int faulty_pass(struct faulty_link *link, int session, int64_t t_ns);
/* A command of the session changed the faults. The command's own reply is the last of the next n_replies. */
void faulty_changed(struct faulty_link *link, int session, uint64_t n_replies);

/* Notes the end of a pulled cable: it is plugged in, or another fault of the link replaces it, or the run ends. Does
 * nothing where no cable is pulled. */
void faulty_end_cable(struct faulty_link *link);

struct faulty_state {
    int waits;        /* bytes wait in the wire */
    int keeps_back;   /* a fault holds them back; else they wait for the inner link */
    int64_t moved_ns; /* clock: when the inner link last took a byte; 0: never */
};
struct faulty_state faulty_look(const struct faulty_link *link, int session);

/* Frames of the stream, or units, that were taken by write() and did not go out as a whole, or were discarded after a
 * fault had ended the session; and the pulses in them. */
struct faulty_unwritten {
    uint64_t frames, pulses;
};
/* Drops what waits for a session that is over, or begins anew. Returns what was dropped. */
struct faulty_unwritten faulty_forget(struct faulty_link *link, int session);

#endif
