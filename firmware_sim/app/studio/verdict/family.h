/* SPDX-License-Identifier: MIT */
/* The processes that descend from this one, by Linux's /proc. A client may leave its process group, but it stays
 * a descendant: this process adopts what its children leave behind (PR_SET_CHILD_SUBREAPER). */
#ifndef FIRMWARE_SIM_APP_STUDIO_VERDICT_FAMILY_H
#define FIRMWARE_SIM_APP_STUDIO_VERDICT_FAMILY_H

#include <sys/types.h>

/* Calls `see` for each process that descends from this one, descendants before their ancestors, until a call returns 1.
 * Returns 1 then, else 0. A process that starts meanwhile may be missing. */
int family_any(int (*see)(void *ctx, pid_t pid), void *ctx);

#endif
