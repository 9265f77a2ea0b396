/* SPDX-License-Identifier: MIT */
/* A row of the sheet: how many faults of a kind were injected, and what the client noticed of them. */
#ifndef FIRMWARE_SIM_APP_STUDIO_SOAK_ROW_H
#define FIRMWARE_SIM_APP_STUDIO_SOAK_ROW_H

#include <stdint.h>

#include "firmware_sim/fault/fault.h"

/* A row of the sheet is a kind of fault; flips with right checksums have one of their own. */
enum { SOAK_RESEALED = FAULT_N_KINDS, SOAK_N_ROWS };

struct soak_row {
    uint64_t injected;
    uint64_t noticed;  /* by the client, at its place */
    uint64_t hidden;   /* that no client could notice there; `why` says the last reason */
    uint64_t missed;   /* that it should have noticed */
    uint64_t lost;     /* frames that the client did not get because of it */
    uint64_t accepted; /* faults in frames that the client took, though these differ from the clean ones */
    const char *why;
};

/* n faults could not be noticed. */
static inline void soak_hide(struct soak_row *row, uint64_t n, const char *why)
{
    row->hidden += n;
    if (n != 0) row->why = why;
}

#endif
