/* Looking at the scene as the head does, to try methods: pulses of some of the stations, drawn by core/plan. */
#ifndef FIRMWARE_SIM_SITE_LOOK_H
#define FIRMWARE_SIM_SITE_LOOK_H

#include "firmware_sim/site.h"

enum { SITE_LOOK_PLACES = 4 };

struct site_look {
    struct site *site;
    struct plan_place place[SITE_LOOK_PLACES];
    struct site_look_at {
        const struct site *site;
        uint32_t station;
    } at[SITE_LOOK_PLACES];
    uint32_t n;
    struct plan_sample *sample; /* the caller's to free, also after an error */
};

/* Some of the stations, evenly; with the beams that they have by then. The look stays where it is. */
int site_look_open(struct site_look *look, struct site *site, const struct sh_report *report, struct sh_err *err);
/* Before that: the stations it is going to take, 0 .. site_look_count - 1. */
uint32_t site_look_count(const struct site *site);
uint32_t site_look_station(const struct site *site, uint32_t i);

#endif
