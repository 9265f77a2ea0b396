/* The bytes of one session through the faults of its link.
 *
 * In: frames of the native protocol, units of another one, reply lines, in the order in which the session would write
 * them; the clock. Out: pieces to be written, with the time before which they must not go out, and acts that the owner
 * carries out on its link (to hang up, to unplug, and so on) when they are the first. Each fault that strikes is noted
 * on the board. Without faults a session has no wire.
 *
 * Thread: one, but for the board. Allocates. */
#ifndef FIRMWARE_SIM_FAULT_WIRE_H
#define FIRMWARE_SIM_FAULT_WIRE_H

#include "firmware_sim/fault/tally.h"
#include "firmware_sim/fault/wire_queue.h"

struct wire;

struct wire_spec {
    struct fault_board *board;
    uint32_t link, session; /* from 1 */
    uint32_t max_unit;      /* the longest frame or unit */
    int units;              /* 1: each unit is a write of its own */
    int native;             /* frames of the native protocol */
    int datagrams;          /* 1: units with a checksum of the system's, which drops those that are damaged on their way */
    /* Of the protocol (protocol.h). */
    void (*content)(const uint8_t *unit, size_t len, uint8_t *mask);
    void (*reseal)(uint8_t *unit, size_t len);
    uint32_t acts; /* what the link can do: bit 0 is FAULT_DISCONNECT, and so on; others don't strike */
    struct fault_tally *tally; /* of its acts, over all sessions of the link; outlives the wire. NULL: by session */
};

/* NULL: no memory. */
struct wire *wire_create(const struct wire_spec *spec);
void wire_free(struct wire *wire);

/* What a session would write. t_ns: device time. Native frames say which counting they belong to themselves. */
struct wire_item {
    int of; /* enum fault_of */
    const uint8_t *bytes;
    size_t len;
    int64_t t_ns;
};
/* Returns 0, or SH_ENOMEM: it is lost. */
int wire_put(struct wire *wire, const struct wire_item *item, int64_t now_ns);
/* What the client sent: what an echo sends back with the next reply. */
void wire_heard(struct wire *wire, const void *bytes, size_t len);

/* The first piece, or act, if it may go out now; NULL: none may. With `all` nothing is held for frames that won't
 * come any more. Its bytes from `out` on are to be written, which the owner moves on. */
struct wire_piece *wire_due(struct wire *wire, int64_t now_ns, int all);
/* When the next one may; INT64_MAX: there is none. */
int64_t wire_next_ns(const struct wire *wire);
void wire_pop(struct wire *wire);
/* Bytes that wait. */
size_t wire_bytes(const struct wire *wire);
int wire_is_empty(const struct wire *wire);

#endif
