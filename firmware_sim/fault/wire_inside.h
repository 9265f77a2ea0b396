/* Private to wire.c and wire_change.c. */
#ifndef FIRMWARE_SIM_FAULT_WIRE_INSIDE_H
#define FIRMWARE_SIM_FAULT_WIRE_INSIDE_H

#include "firmware_sim/fault/wire.h"

enum { WIRE_HEARD_LEN = 1024 };

/* A fault of the list, as far as this session goes. */
struct wire_fault {
    struct fault_entry entry;
    uint64_t base[FAULT_N_OF]; /* of each counting, what came before it was there */
    uint64_t hits;
};

struct wire {
    struct wire_spec spec;
    uint32_t version; /* of the list */
    struct wire_fault fault[FAULT_MAX];
    uint32_t n_faults;
    uint64_t count[FAULT_N_OF];
    struct wire_queue queue;
    int64_t last_due_ns; /* delays keep the order */
    uint8_t *unit;       /* the one at hand, and the copy that faults change */
    uint8_t *mask;       /* its bits that a flip may change */
    uint8_t *last_reply; /* the reply before */
    size_t last_reply_len;
    uint8_t heard[WIRE_HEARD_LEN]; /* since the last reply; what is beyond is not echoed */
    size_t heard_len;
};

/* The frame, unit or reply at hand, and what becomes of it. */
struct wire_making {
    const struct wire_item *item;
    struct fault_spot spot; /* its number is that of the session, from 1 */
    enum wire_piece_kind kind;
    size_t len; /* of wire->unit */
    int dropped;
    uint32_t copies;
    uint32_t behind;
    int64_t not_before_ns;
    int holds_alone; /* not_before_ns holds back this one alone */
    double quiet_ms;
    uint32_t split; /* writes that it goes out in */
    uint32_t joins; /* frames after it that go out with it */
    int64_t now_ns;
};

/* What the fault does to it; notes it. `number` is the frame's, as this fault counts. Returns 0 or SH_ENOMEM. */
int wire_change(struct wire *wire, const struct wire_fault *fault, uint64_t number, struct wire_making *making);

#endif
