/* Georeferencing of a site's stations: heights, CRS, method, and how many metres a count is on the wire. */
#ifndef FIRMWARE_SIM_SITE_GEOREFERENCE_H
#define FIRMWARE_SIM_SITE_GEOREFERENCE_H

#include "firmware_sim/site/site.h"

/* Stations are placed, the path of a moving head is known. Fills the stations' georef, plan, scale and leg, and
 * site->scale_m. Warns where a tolerance is not met. */
int site_georeference(struct site *site, const struct sh_report *report, struct sh_err *err);

#endif
