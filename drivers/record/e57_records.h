/* SPDX-License-Identifier: MIT */
/* Points as records of E57. In: a track's batch, in columns. Out: the streams of a packet. Pure. */
#ifndef DRIVERS_RECORD_E57_RECORDS_H
#define DRIVERS_RECORD_E57_RECORDS_H

#include "drivers/record/e57_packet.h"
#include "drivers/record/track.h"

/* Puts the n points of the batch from `first` on into the packet, which has room for them. Coordinates are in the
 * head's frame, as counts of scale_m of the file's last scan. A point without an echo is an empty shot. Returns 0, or
 * -1 where 32 bits don't hold the counts of all points. Then only the points before the first one that does not fit are
 * put, and far_m is that first one's place. */
int e57_records_put(struct e57_packet *packet, const struct e57_facts *facts, const struct track *track, int first,
                    int n, double far_m[3]);

#endif
