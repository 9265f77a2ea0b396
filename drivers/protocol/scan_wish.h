/* SPDX-License-Identifier: MIT */
/* A client's wish that the head scans. The wish lasts until a turn shows that the head scans on, or that a scan began
 * after the wish. A head that is told to stop still sends the turns that it had made by then: such a turn does not
 * fulfil the wish, since no other follows.
 *
 * The session may be at an earlier tick than the head. A scan that the session itself has started may thus be over in
 * the head before its first turn comes, so the head's state alone can't tell.
 *
 * Pure but for the question to the head. Nothing is allocated. */
#ifndef DRIVERS_PROTOCOL_SCAN_WISH_H
#define DRIVERS_PROTOCOL_SCAN_WISH_H

#include "drivers/protocol/planar_scan.h"
#include "drivers/protocol/protocol.h"

struct scan_wish {
    int lasts;
    int64_t t_ns;     /* the session's device time when the wish was made, or when the head was last started for it */
    int64_t start_ns; /* the session's device time of its last SCAN:STARt; INT64_MAX: there was none */
    const struct protocol_identity *identity; /* how long the head spins up, and frames wait; outlives the wish */
};

/* At power-up: there is no wish, and the session has not started the head. */
void scan_wish_reset(struct scan_wish *wish, const struct protocol_identity *identity);
/* The client asks for scans. */
void scan_wish_make(struct scan_wish *wish, int64_t t_ns);
/* The session has started the head, for the wish or for another reason. */
void scan_wish_start(struct scan_wish *wish, int64_t t_ns);
/* Returns whether the first turn after the session's own SCAN:STARt may still be to come. Until then the head is not
 * started again, though it may be idle: the scan may be over there. */
int scan_wish_is_starting(const struct scan_wish *wish, const struct planar_scan *scan, int64_t now_ns);
/* A turn has come: scan->whole. Asks the head for its state if the turn itself does not fulfil the wish. */
void scan_wish_take_turn(struct scan_wish *wish, const struct planar_scan *scan, const struct protocol_host *host);

#endif
