/* SPDX-License-Identifier: MIT */
/* `scanhead check` prints this about places, in metres and degrees. In: a loaded site. Out: lines with the anchor, and
 * with each station in every coordinate frame that is known. A stop has only its scene and geodetic coordinates. */
#ifndef FIRMWARE_SIM_APP_CHECK_PLACES_H
#define FIRMWARE_SIM_APP_CHECK_PLACES_H

#include <stdio.h>

#include "firmware_sim/site/site.h"

void check_print_anchor(const struct site *site, FILE *out);
void check_print_station(const struct site *site, uint32_t i, FILE *out);
/* A line with the times of all stops, then one line for each stop. */
void check_print_stops(const struct site *site, FILE *out);

#endif
