/* SPDX-License-Identifier: MIT */
/* Connections that the head has ended, and that the client still has. */
#ifndef FIRMWARE_SIM_APP_STUDIO_VERDICT_HELD_H
#define FIRMWARE_SIM_APP_STUDIO_VERDICT_HELD_H

#include "firmware_sim/app/studio/verdict/watch.h"

/* Whether there is one among those after which nobody came back: by the system's table of TCP over IPv4, so of clients on
 * this machine. */
int held_any(struct watch *watch);

#endif
