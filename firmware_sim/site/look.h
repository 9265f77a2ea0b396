/* Looking at the scene as the head does: the places that pulses are fired from, with setups as the run's. For trying
 * methods (core/plan draws the pulses), and for measuring what they cost. */
#ifndef FIRMWARE_SIM_SITE_LOOK_H
#define FIRMWARE_SIM_SITE_LOOK_H

#include "firmware_sim/site/site.h"

enum { SITE_LOOK_STATIONS = 4 }; /* at most so many stations are looked from */

struct site_look {
    struct plan_place place[SITE_LOOK_STATIONS];
    struct site_look_at {
        const struct site *site;
        uint32_t station;
    } at[SITE_LOOK_STATIONS];
    uint32_t n;
};

/* Looks from up to SITE_LOOK_STATIONS stations, evenly chosen, with the beams that they have by then. The look must not
 * be moved or copied: its places point into it. */
void site_look_open(struct site_look *look, const struct site *site);

#endif
