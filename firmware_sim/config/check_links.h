/* SPDX-License-Identifier: MIT */
/* Checks of links: their keys, their protocols, and the identity of a USB device. */
#ifndef FIRMWARE_SIM_CONFIG_CHECK_LINKS_H
#define FIRMWARE_SIM_CONFIG_CHECK_LINKS_H

#include <stdint.h>

#include "core/err.h"
#include "drivers/protocol/protocol.h"

struct cfg_reader;
struct config;
struct config_profile;
struct link_spec;

/* Checks keys that only some kinds of link have, and what a link needs. */
void cfg_check_links(struct cfg_reader *rd, struct config *cfg);
/* Fills in the USB identity of a usb link from its protocol; ids and serial number only if they are not given. */
void cfg_set_usb_identity(struct cfg_reader *rd, const struct config *cfg, struct link_spec *link, uint32_t item);
/* Checks that each link's kind can have its protocol, and sets what follows from a protocol. */
void cfg_check_protocols_alone(struct cfg_reader *rd, struct config *cfg);
/* Does the same, and checks what the protocols need of the stream and of the head. */
void cfg_check_link_protocols(struct cfg_reader *rd, struct config *cfg);
/* Returns whether the protocol can describe a head of this profile. Where the kind and the number of beams are allowed,
 * and something else is not, *why says what, as protocol_ops.check_head does. */
int cfg_protocol_fits(const struct protocol_ops *ops, const struct config_profile *profile, struct sh_err *why);
/* Returns the first link whose protocol has this need; -1: none. */
int cfg_link_that_needs(const struct config *cfg, enum protocol_needs need);

#endif
