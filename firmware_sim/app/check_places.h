/* What `scanhead check` says about places: the anchor, and each station in every frame that is known. */
#ifndef FIRMWARE_SIM_APP_CHECK_PLACES_H
#define FIRMWARE_SIM_APP_CHECK_PLACES_H

#include <stdio.h>

#include "firmware_sim/site/site.h"

void check_print_anchor(const struct site *site, FILE *out);
int check_print_station(const struct site *site, uint32_t i, FILE *out, struct sh_err *err);

/* A line for each stop. */
void check_print_stops(const struct site *site, FILE *out);

/* Warns of stations that have nothing within the head's range, as the scene stands at the start. */
int check_reach(const struct site *site, const struct sh_report *report, struct sh_err *err);

#endif
