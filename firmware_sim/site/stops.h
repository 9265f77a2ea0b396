/* Private to this folder: a head that scans where its platform stops (platform.kind: stops). In: the configured
 * trajectory and times. Out: a station for each stop, placed in the scene. */
#ifndef FIRMWARE_SIM_SITE_STOPS_H
#define FIRMWARE_SIM_SITE_STOPS_H

#include "firmware_sim/site/site.h"

/* Puts the stops in the place of the configuration's only station. That one has been placed: without an anchor it says
 * where on the Earth the scene lies, as an anchor at its position with the scene's y axis to true north would. */
int site_load_stops(struct site *site, struct sh_err *err);

#endif
