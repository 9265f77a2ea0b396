/* SPDX-License-Identifier: MIT */
/* Connections that the head has ended, and that the client still has. In: the peers of sessions that have ended. Out:
 * whether there is one. The module reads Linux's /proc, so it knows only clients on this machine, and only those that
 * connect by IPv4. */
#ifndef FIRMWARE_SIM_APP_STUDIO_VERDICT_HELD_H
#define FIRMWARE_SIM_APP_STUDIO_VERDICT_HELD_H

#include "firmware_sim/app/studio/verdict/watch.h"

/* Returns whether there is such a connection, among those of sessions after which nobody came back. */
int held_any(struct watch *watch);

#endif
