/* Looking at the scene as the head does, to try methods: pulses of some of the stations, drawn by core/plan. */
#ifndef FIRMWARE_SIM_SITE_LOOK_H
#define FIRMWARE_SIM_SITE_LOOK_H

#include "firmware_sim/site/site.h"

struct site_look {
    struct site *site;
    struct plan_place *place; /* [n] */
    struct site_look_at {
        const struct site *site;
        uint32_t station;
    } * at; /* [n] */
    uint32_t n;
    struct plan_sample *sample;
};

/* Of `most` of the stations, or all there are: how many that makes, and which. */
uint32_t site_look_count(const struct site *site, uint32_t most);
uint32_t site_look_station(const struct site *site, uint32_t most, uint32_t i);
/* Looks from these, with the beams that they have by then. To be closed, after an error, too; a look of zeros may be.
 */
int site_look_open(struct site_look *look, struct site *site, uint32_t most, const struct sh_report *report,
                   struct sh_err *err);
void site_look_close(struct site_look *look);

#endif
