/* SPDX-License-Identifier: MIT */
/* How often each fault of the list has struck, over all sessions of a link. The tally serves faults whose `count` holds
 * for the link, not for each session.
 *
 * In: a fault's number. Out: its count, which the caller raises. Thread: one. */
#ifndef FIRMWARE_SIM_FAULT_TALLY_H
#define FIRMWARE_SIM_FAULT_TALLY_H

#include "firmware_sim/fault/board.h"

/* Set to zeroes at first. */
struct fault_tally {
    uint32_t number[FAULT_KEPT]; /* 0: free */
    uint64_t hits[FAULT_KEPT];
};

/* The list has changed: drops the counts of faults that are not in it. */
void fault_tally_renew(struct fault_tally *tally, const struct fault_entry *entry, uint32_t n);
/* Returns the count of a fault that is in the list. */
uint64_t *fault_tally_hits(struct fault_tally *tally, uint32_t number);
/* Takes back one count: what it stands for was not carried out. */
void fault_tally_take_back(struct fault_tally *tally, uint32_t number);

#endif
