/* SPDX-License-Identifier: MIT */
/* Private to faulty_link.c and faulty_acts.c. */
#ifndef FIRMWARE_SIM_FAULT_FAULTY_INSIDE_H
#define FIRMWARE_SIM_FAULT_FAULTY_INSIDE_H

#include "firmware_sim/fault/faulty_link.h"
#include "firmware_sim/fault/wire.h"

struct faulty_session {
    struct wire *wire;       /* NULL: no fault so far */
    struct wire_heard heard; /* from the session's begin on */
    size_t rest;             /* bytes still to come of a frame, line or unit that was begun without a wire */
    int next_is_reply;       /* the next unit is a reply; faulty_next sets this and its time */
    int64_t next_t_ns;
    int is_blocked; /* the inner link takes nothing now */
    int is_gone;    /* an act has ended it */
    int64_t moved_ns;
};

/* Faults at connections (USB: at enumerations). */
struct faulty_connections {
    uint64_t n;       /* connections so far, refused ones too */
    uint32_t version; /* of the list */
    struct faulty_connection {
        struct fault_entry entry;
        uint64_t base; /* connections before it was there */
    } fault[FAULT_MAX];
    uint32_t n_faults;
};

struct faulty_link {
    struct faulty_spec spec;
    struct link_ops ops;
    const struct link_ops *inner;
    void *link; /* the inner one */
    uint32_t can;
    struct fault_tally tally; /* of what the link does */
    struct faulty_session session[LINK_MAX_SESSIONS];
    struct faulty_connections connections;
    int64_t plug_ns;          /* clock: when an unplugged link is there again; 0: it is */
    struct fault_note pulled; /* of the last pull of the cable; at its end `ended` is 1, and t_ns is the end's time */
    int resets;               /* 1: what was connected is reset once that cable is in again */
    int plug_failed;          /* it could not come back so far, and that was reported */
    int64_t refuse_until_ns;  /* clock: until then clients are turned away */
};

/* faulty_acts.c */
/* Carries out the act that is first in the session's wire. */
void faulty_carry_out(struct faulty_link *f, int session, const struct wire_piece *act);
/* Whether the cable of the link is pulled now. */
int faulty_is_pulled(const struct faulty_link *f);
/* Whether the act belongs to the pull of the cable that another session has begun: it is of the same fault, and was due
 * before the cable was in again. A link has one cable, so it is pulled once for all sessions. */
int faulty_is_same_pull(const struct faulty_link *f, const struct wire_piece *act);
/* Takes out the act that is first in the session's wire, without carrying it out. The link's count of the fault no
 * longer includes the act. */
void faulty_drop_act(struct faulty_link *f, int session, const struct wire_piece *act);
/* Brings an unplugged link back when its time is over. */
void faulty_plug(struct faulty_link *f);
/* The link's fault(), called by its owner. PLUG brings an unplugged link back. Any other fault first ends the effects
 * of earlier ones, and is then passed to the inner link. */
int faulty_fault(void *link, enum link_fault what, int session, uint32_t n, double for_ms);
/* A client has come. 1: it is turned away, by an injected fault. */
int faulty_turns_away(struct faulty_link *f, int session);
/* A host has got the USB device. */
void faulty_plugged(struct faulty_link *f);

#endif
