/* SPDX-License-Identifier: MIT */
/* The client of a link that sends datagrams. The datagrams are compared with those of a second link, which has the
 * same protocol and no faults. */
#ifndef FIRMWARE_SIM_APP_STUDIO_SOAK_DATAGRAMS_H
#define FIRMWARE_SIM_APP_STUDIO_SOAK_DATAGRAMS_H

#include <stdint.h>

#include "drivers/link/link.h"
#include "firmware_sim/app/studio/soak/frame.h"

struct soak_datagrams;
struct soak_link;

/* Opens sockets for the datagrams of a link and of a second, clean link. *clean_link becomes that second link, which
 * the caller opens beside the first. NULL: not possible. */
struct soak_datagrams *soak_datagrams_open(const struct link_spec *spec, struct link_spec *clean_link);
void soak_datagrams_close(struct soak_datagrams *datagrams);
int soak_datagrams_get(const struct soak_datagrams *datagrams, soak_seq seq, struct soak_clean_frame *out);
void soak_datagrams_step(struct soak_link *link);
/* Waits for datagrams that are still on their way, and takes them. */
void soak_datagrams_finish(struct soak_link *link);
uint64_t soak_datagrams_top(struct soak_link *link);
/* Returns a datagram's number in the ledger. number: its number on its link, from 1. */
soak_seq soak_unit(uint64_t number);

#endif
