/* SPDX-License-Identifier: MIT */
/* Private to wire.c and wire_change.c. */
#ifndef FIRMWARE_SIM_FAULT_WIRE_INSIDE_H
#define FIRMWARE_SIM_FAULT_WIRE_INSIDE_H

#include "firmware_sim/fault/wire.h"

/* A fault of the list, with this session's counts. */
struct wire_fault {
    struct fault_entry entry;
    uint64_t base[FAULT_N_OF]; /* items of each fault_of that came before the fault was added */
    uint64_t hits;
};

struct wire {
    struct wire_spec spec;
    uint32_t version; /* of the list */
    struct wire_fault fault[FAULT_KEPT];
    uint32_t n_faults;
    uint64_t count[FAULT_N_OF];
    uint64_t merge_until[FAULT_N_OF]; /* frames up to this number go into a write that a merge began */
    struct wire_queue queue;
    int64_t last_due_ns;               /* due time of the last piece: delays keep the order */
    int64_t reply_due_ns;              /* due time of the last reply: late replies keep their order */
    int is_over;                       /* an act that ends the session waits: later items are discarded */
    uint64_t void_frames, void_pulses; /* discarded for that */
    uint8_t *unit;                     /* the copy of the item at hand, which faults change */
    uint8_t *mask;                     /* the bits of it that a flip may change */
    size_t unit_room, mask_room;
    uint8_t *last_reply; /* the reply before */
    size_t last_reply_len, last_reply_room;
};

/* The frame, unit or reply at hand, and the changes that faults make to it. */
struct wire_making {
    const struct wire_item *item;
    struct fault_spot spot; /* its number is that of the session, from 1 */
    enum wire_piece_kind kind;
    uint32_t frames; /* as wire_count_unwritten counts them */
    uint64_t pulses;
    size_t len; /* of wire->unit */
    int is_dropped, is_cut;
    uint32_t copies;
    uint32_t behind; /* frames that overtake it */
    int64_t not_before_ns;
    int64_t hold_ns; /* of a reply: it alone is held back until then */
    uint32_t split;  /* writes that it goes out in; 1: no split */
    int opens;       /* frames after it go out with it */
    int64_t now_ns;
};

/* Applies the fault to the item, and notes it. `number` is the frame's, as this fault counts. Returns 1; 0: the fault
 * has nothing to do; or SH_ENOMEM. */
int wire_change(struct wire *wire, const struct wire_fault *fault, uint64_t number, struct wire_making *making);

#endif
