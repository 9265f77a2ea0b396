/* SPDX-License-Identifier: MIT */
/* The processes that descend from this one, by Linux's /proc. A client may leave its process group, but not its family:
 * this process is then the parent of what its own children leave behind. */
#ifndef FIRMWARE_SIM_APP_STUDIO_VERDICT_FAMILY_H
#define FIRMWARE_SIM_APP_STUDIO_VERDICT_FAMILY_H

#include <sys/types.h>

/* Calls `see` for each one, descendants before their ancestors, until it returns 1; then that, else 0. One that is
 * started meanwhile may be missing. */
int family_any(int (*see)(void *ctx, pid_t pid), void *ctx);

#endif
