/* SPDX-License-Identifier: MIT */
/* A look is the stations that pulses are fired from, with setups like the run's. core/plan takes random samples of
 * these pulses to compare methods. The cost of methods is measured with these pulses, too (rate.c). */
#ifndef FIRMWARE_SIM_SITE_LOOK_H
#define FIRMWARE_SIM_SITE_LOOK_H

#include "core/plan.h"

struct site;

enum { SITE_LOOK_STATIONS = 4 }; /* most stations of a look */

struct site_look {
    struct plan_place place[SITE_LOOK_STATIONS];
    struct site_look_at {
        const struct site *site;
        uint32_t station;
    } at[SITE_LOOK_STATIONS];
    uint32_t n;
};

/* Opens a look from up to SITE_LOOK_STATIONS stations, evenly chosen, with the beams that the site has now. The look
 * must not be moved or copied: its places point into it. */
void site_look_open(struct site_look *look, const struct site *site);

#endif
