/* SPDX-License-Identifier: MIT */
/* A client's wish that the head scans. The wish lasts until a turn shows that the head scans on. A head that is told to
 * stop still sends the turns that it had made by then: such a turn does not fulfil the wish, since no other follows.
 *
 * Pure but for the question to the head. Nothing is allocated. */
#ifndef DRIVERS_PROTOCOL_SCAN_WISH_H
#define DRIVERS_PROTOCOL_SCAN_WISH_H

#include "drivers/protocol/planar_scan.h"
#include "drivers/protocol/protocol.h"

struct scan_wish {
    int lasts;
    uint32_t scan; /* the head's scan when the wish was made, or when the head was last started for it */
};

/* The client asks for scans, or the head was started for it. */
void scan_wish_make(struct scan_wish *wish, const struct planar_scan *scan);
/* A turn has come. Asks the head for its state while the wish lasts. */
void scan_wish_take_turn(struct scan_wish *wish, const struct planar_scan *scan, const struct protocol_host *host);

#endif
